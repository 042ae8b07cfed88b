import { bytes, count, figure, short_count, title } from '../parts/format.ts';
import type { Density, Series } from './series.ts';
import { thinned } from './thin.ts';

// What is drawn in each chart.

export interface Line {
  name: string;
  colour: number; // of the theme's series, from 1
  values: (number | null)[];
  dots?: boolean; // single points rather than a line
  dashed?: boolean;
  hidden?: boolean; // there for the scale and the readout; `bars` draw it
}

export interface Chart {
  id: string;
  title: string;
  x: number[];
  lines: Line[];
  format: (value: number) => string;
  axis?: (value: number) => string; // shorter, beside the axis
  log?: boolean;
  from_zero?: boolean;
  over?: 'iterations' | 'time'; // what x is: iterations unless said, or times in [0, 1]
  bars?: Density;
  marks: number[]; // iterations of opacity resets
}

const most_points = 1200;

function thin_chart(chart: Chart): Chart {
  const kept = thinned(chart.lines[0]?.values ?? [], most_points);
  if (kept.length === chart.x.length) return chart;
  const pick = <T>(column: readonly T[]): T[] => kept.map((i) => column[i] as T);
  return { ...chart, x: pick(chart.x), lines: chart.lines.map((line) => ({ ...line, values: pick(line.values) })) };
}

const positive = (values: (number | null)[]): (number | null)[] => values.map((v) => (v !== null && v > 0 ? v : null));

function loss({ steps }: Series, log: boolean): Chart {
  const terms = [...steps.terms].filter(([, values]) => values.some((v) => v !== 0));
  const lines: Line[] = [{ name: 'Loss', colour: 1, values: steps.loss }];
  terms.forEach(([name, values], i) => lines.push({ name: title(name), colour: 2 + (i % 6), values }));
  if (log) for (const line of lines) line.values = positive(line.values);
  return {
    id: 'loss',
    title: 'Loss',
    x: steps.iteration,
    lines,
    format: figure,
    axis: compact,
    log,
    from_zero: !log,
    marks: [],
  };
}

function psnr({ steps, held_out }: Series): Chart {
  const training = thin_chart({
    id: 'psnr',
    title: 'PSNR',
    x: steps.iteration,
    lines: [{ name: 'Training', colour: 1, values: steps.psnr }],
    format: figure,
    marks: [],
  });
  const db = (v: number): string => `${v.toFixed(2)} dB`;
  if (held_out.iteration.length === 0) return { ...training, format: db, axis: (v) => v.toFixed(0) };
  const x = [...new Set([...training.x, ...held_out.iteration])].sort((a, b) => a - b);
  const at = (from: readonly number[], values: readonly (number | null)[]): (number | null)[] => {
    const known = new Map(from.map((iteration, i) => [iteration, values[i] ?? null]));
    return x.map((iteration) => known.get(iteration) ?? null);
  };
  return {
    ...training,
    x,
    lines: [
      { name: 'Training', colour: 1, values: at(training.x, training.lines[0]?.values ?? []) },
      { name: 'Held out', colour: 2, values: at(held_out.iteration, held_out.psnr), dots: true },
    ],
    format: db,
    axis: (v) => v.toFixed(0),
  };
}

function surfels({ steps, density }: Series): Chart {
  return {
    id: 'surfels',
    title: 'Surfels',
    x: steps.iteration,
    lines: [
      { name: 'Main', colour: 1, values: steps.main },
      { name: 'Environment', colour: 2, values: steps.environment },
    ],
    format: count,
    axis: short_count,
    from_zero: true,
    marks: density.main.resets,
  };
}

function changes(density: Density): Chart {
  return {
    id: 'density',
    title: 'Changes',
    x: density.iteration,
    lines: [
      { name: 'Cloned', colour: 3, values: density.cloned, hidden: true },
      { name: 'Split', colour: 2, values: density.split, hidden: true },
      { name: 'New surface', colour: 5, values: density.added, hidden: true },
      { name: 'Pruned, transparent', colour: 7, values: density.transparent, hidden: true },
      { name: 'Pruned, large', colour: 4, values: density.large, hidden: true },
    ],
    format: count,
    axis: (v) => short_count(Math.abs(v)),
    bars: density,
    marks: density.resets,
  };
}

export function charts_of(series: Series, log: boolean, set: 'main' | 'environment'): Chart[] {
  const { steps } = series;
  const single = (
    id: string,
    name: string,
    colour: number,
    values: (number | null)[],
    format: Chart['format'],
    axis = format,
  ): Chart =>
    thin_chart({
      id,
      title: name,
      x: steps.iteration,
      lines: [{ name, colour, values }],
      format,
      axis,
      from_zero: true,
      marks: [],
    });
  const charts = [thin_chart(loss(series, log)), psnr(series), thin_chart(surfels(series))];
  if (series.density.main.iteration.length + series.density.environment.iteration.length > 0)
    charts.push(changes(series.density[set]));
  charts.push(single('rate', 'Iterations a second', 3, steps.rate, (v) => v.toFixed(1), compact));
  if (steps.memory.some((m) => m !== null)) charts.push(single('memory', 'Memory', 5, steps.memory, bytes));
  return charts;
}

// 0.0100 → 0.01, 0.00010 → 1e-4
function compact(v: number): string {
  const rounded = Number(v.toPrecision(3));
  return rounded !== 0 && Math.abs(rounded) < 1e-3 ? rounded.toExponential() : String(rounded);
}
