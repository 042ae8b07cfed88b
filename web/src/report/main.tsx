import { render } from 'preact';
import { start_theme } from '../state/theme.ts';
import type { ReportData } from './data.ts';
import { Report } from './Report.tsx';

start_theme();

const text = document.getElementById('report')?.textContent ?? 'null';
const data = JSON.parse(text) as ReportData | null;
const root = document.getElementById('page');
if (data) document.title = `${data.run} · TraceFlow report`;
if (root)
  render(
    data ? (
      <Report data={data} />
    ) : (
      <p class="empty">This page is the empty form of a report: traceflow report fills it.</p>
    ),
    root,
  );
