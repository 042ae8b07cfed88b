import { effect, useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import uPlot from 'uplot';
import type { ComponentChildren } from 'preact';
import { count } from '../parts/format.ts';
import { repaint } from '../state/theme.ts';
import type { Chart, Line } from './charts.ts';
import { bands_plugin, bars_plugin, css_colour } from './drawing.ts';
import type { Phase } from './series.ts';

interface PlotProps {
  chart: Chart;
  aside?: ComponentChildren; // beside the title
  phases: Phase[];
  height: number;
}

const font = '11px system-ui, sans-serif';

// One chart with its title and a line of figures: those under the cursor, else the last ones.
export function Plot({ chart, aside, phases, height }: PlotProps) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const tall = chart.lines.length > 3 ? Math.round(height * 1.3) : height;
  const newest = useRef({ chart, phases });
  newest.current = { chart, phases };
  const index = useSignal<number | null>(null);
  const shape = `${chart.log} ${chart.title} ${chart.lines.map((line) => line.name).join()}`;

  useEffect(() => {
    const element = box.current;
    if (!element) return;
    const made = new uPlot(
      options(newest, element.clientWidth, tall, (i) => (index.value = i)),
      data_of(newest.current.chart),
      element,
    );
    plot.current = made;
    const observer = new ResizeObserver(() => made.setSize({ width: element.clientWidth, height: tall }));
    observer.observe(element);
    return () => {
      observer.disconnect();
      made.destroy();
      plot.current = null;
    };
  }, [shape, tall]);

  useEffect(() => plot.current?.setData(data_of(chart)), [chart]);
  useEffect(() => plot.current?.redraw(false), [phases]);
  // At once, for the colours of a page that is being printed.
  useEffect(() => effect(() => void (repaint.value && plot.current?.redraw(false))), []);

  const at = index.value ?? chart.x.length - 1;
  const place = (x: number): string => (chart.over === 'time' ? x.toFixed(3) : count(x));
  return (
    <figure class="plot" data-testid={`curve-${chart.id}`} data-points={chart.x.length}>
      <figcaption>
        <b>{chart.title}</b>
        <span>{index.value !== null && chart.x[at] !== undefined ? `at ${place(chart.x[at])}` : ''}</span>
        {aside}
      </figcaption>
      <ul class="plot-values">
        {chart.lines.map((line) => (
          <Value key={line.name} line={line} at={at} format={chart.format} />
        ))}
      </ul>
      <div
        ref={box}
        class="plot-box"
        style={{ height: `${tall}px` }}
        role="img"
        aria-label={`${chart.title} over the ${chart.over ?? 'iterations'}`}
      />
    </figure>
  );
}

function Value({ line, at, format }: { line: Line; at: number; format: (value: number) => string }) {
  const value = line.dots ? last_until(line.values, at) : line.values[at];
  return (
    <li>
      <i style={{ background: `var(--series-${line.colour})` }} />
      {line.name} <b>{value === null || value === undefined ? '–' : format(value)}</b>
    </li>
  );
}

const last_until = (values: readonly (number | null)[], at: number): number | null =>
  values.slice(0, at + 1).findLast((v) => v !== null) ?? null;

// Bars go up for what was added and down for what was taken away, so their scale must hold the sums.
function data_of(chart: Chart): uPlot.AlignedData {
  if (!chart.bars) return [chart.x, ...chart.lines.map((line) => line.values)];
  const { cloned, split, added, transparent, large } = chart.bars;
  const up = cloned.map((n, i) => n + (split[i] ?? 0) + (added[i] ?? 0));
  const down = transparent.map((n, i) => -n - (large[i] ?? 0));
  return [chart.x, up, up, up, down, down];
}

type Newest = { current: { chart: Chart; phases: Phase[] } };

function options(
  newest: Newest,
  width: number,
  height: number,
  on_index: (index: number | null) => void,
): uPlot.Options {
  const { chart } = newest.current;
  const axis = chart.axis ?? chart.format;
  const common = {
    font,
    stroke: () => css_colour('--dim'),
    ticks: { show: false },
    grid: { stroke: () => css_colour('--grid'), width: 1 },
  };
  return {
    width,
    height,
    legend: { show: false },
    padding: [8, 6, 0, 0],
    cursor: {
      y: false,
      drag: { x: false, y: false },
      sync: { key: `curves over ${chart.over ?? 'iterations'}`, scales: ['x', null] },
      points: { size: 6 },
    },
    scales: {
      x: {
        time: false,
        range: (_, low, high) => (chart.over === 'time' ? [0, 1] : across(newest.current.phases, low, high)),
      },
      y: chart.log
        ? { distr: 3, range: (_, low, high) => on_log_scale(low, high) }
        : { range: (_, low, high) => padded(chart.from_zero ? 0 : low, high, chart) },
    },
    axes: [
      { ...common, size: 22, gap: 3, grid: { show: false }, values: (_, splits) => splits.map(chart.over === 'time' ? String : short_iteration) },
      {
        ...common,
        size: 46,
        gap: 4,
        space: 26,
        ...(chart.log && { splits: (_: uPlot, __: number, low: number, high: number) => powers_of_ten(low, high) }),
        values: (_, splits) => splits.map((v) => (v === null ? '' : axis(v))),
      },
    ],
    series: [{}, ...chart.lines.map(series_of_line)],
    plugins: [
      bands_plugin(
        () => newest.current.phases,
        () => newest.current.chart.marks,
      ),
      bars_plugin(() => newest.current.chart.bars),
    ],
    hooks: {
      setCursor: [(u) => on_index(u.cursor.left !== undefined && u.cursor.left >= 0 ? (u.cursor.idx ?? null) : null)],
    },
  };
}

function series_of_line(line: Line): uPlot.Series {
  const stroke = (): string => css_colour(`--series-${line.colour}`);
  if (line.hidden) return { stroke, paths: () => null, points: { show: false } };
  if (line.dots) return { stroke, paths: () => null, points: { show: true, size: 7, fill: stroke } };
  return {
    stroke,
    width: line.colour === 1 ? 2 : 1.2,
    alpha: line.colour === 1 ? 1 : 0.85,
    ...(line.dashed && { width: 1, dash: [4, 4] }),
    spanGaps: true,
    points: { show: false },
  };
}

// Whole powers of ten, five at most: a term that starts near nothing must not press the others flat.
function on_log_scale(low: number, high: number): [number, number] {
  if (!(high > 0)) return [0.1, 1];
  const top = Math.ceil(Math.log10(high) + 0.1);
  return [10 ** Math.max(Math.floor(Math.log10(low)), top - 5), 10 ** top];
}

function powers_of_ten(low: number, high: number): number[] {
  const first = Math.round(Math.log10(low));
  return Array.from({ length: Math.round(Math.log10(high)) - first + 1 }, (_, i) => 10 ** (first + i));
}

// All charts of a run have the same iterations below them.
const across = (phases: Phase[], low: number, high: number): [number, number] => [
  Math.min(low, phases[0]?.first ?? low),
  Math.max(high, phases.at(-1)?.last ?? high, low + 1),
];

function padded(low: number, high: number, { from_zero, over }: Chart): [number, number] {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  const room = (high - low) * 0.08 || Math.abs(high) * 0.1 || 1;
  // Above the iterations the names of the phases have room.
  return [from_zero ? Math.min(low, 0) : low - room, high + (over === 'time' ? 1 : 3) * room];
}

const short_iteration = (v: number): string => (v >= 1000 ? `${Math.round(v / 100) / 10}k` : String(v));
