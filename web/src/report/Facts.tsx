import { bytes, count, duration } from '../parts/format.ts';
import type { ReportData } from './data.ts';

// What was run, on what, and when.
export function Facts({ data }: { data: ReportData }) {
  const { machine, surfels } = data;
  const facts: [string, string][] = [
    ['Run', data.run],
    ['Capture', data.capture],
    ['Views', `${data.views.length} of the ${data.split} split, ${size(data.downscale)}`],
    ['Iterations', count(data.iterations)],
    ['Training took', duration(data.train_seconds)],
    ['Surfels', `${count(surfels.main)} main, ${count(surfels.environment)} environment`],
    ['In masks', surfels.per_masked_pixel === null ? '' : `${surfels.per_masked_pixel.toFixed(2)} main surfels a pixel`],
    ['Rendering', data.render_fps === null ? '' : `${data.render_fps.toFixed(1)} pictures a second`],
    ['Device', data.device],
    ['Processor', `${machine.processor}, ${machine.threads} threads`],
    ['GPU', machine.gpu],
    ['Memory', machine.memory_bytes > 0 ? bytes(machine.memory_bytes) : ''],
    ['System', machine.system],
    ['TraceFlow', data.version],
    ['Report made', moment(data.made)],
  ];
  return (
    <dl class="facts">
      {facts
        .filter(([, value]) => value !== '')
        .map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
    </dl>
  );
}

const size = (downscale: number): string => (downscale === 1 ? 'full size' : `1/${downscale} size`);

function moment(iso: string): string {
  const date = new Date(iso);
  if (Number.isNaN(date.getTime())) return iso;
  const day = date.toLocaleDateString('en-GB', { day: 'numeric', month: 'long', year: 'numeric', timeZone: 'UTC' });
  return `${day}, ${date.toISOString().slice(11, 16)} UTC`;
}
