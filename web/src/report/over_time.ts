import type { Chart, Line } from '../curves/charts.ts';
import type { Figures, ObjectMotion, ReportData } from './data.ts';

// How figures change over the capture's time: a mean hides what drifts.

type Name = keyof Figures;

const fixed =
  (digits: number, unit = '') =>
  (value: number): string =>
    `${value.toFixed(digits)}${unit}`;

// Some line must have two values, else there is nothing to see.
const is_seen = ({ lines }: Chart): boolean =>
  lines.some(({ values }) => values.filter((value) => value !== null).length > 1);

function chart(id: string, title: string, x: number[], lines: Line[], digits: number, unit = ''): Chart {
  return {
    id,
    title,
    x,
    lines: lines.filter(({ values }) => values.some((value) => value !== null)),
    format: fixed(digits, unit),
    axis: (value) => String(Number(value.toFixed(digits))),
    over: 'time',
    marks: [],
  };
}

// Views of one time are taken together.
function charts_of_views(views: ReportData['views']): Chart[] {
  const x = [...new Set(views.map(({ time }) => time))].sort((a, b) => a - b);
  const mean_at = (time: number, name: Name): number | null => {
    const values = views.filter((view) => view.time === time).map((view) => view[name]);
    const known = values.filter((value) => value !== null);
    return known.length > 0 ? known.reduce((a, b) => a + b, 0) / known.length : null;
  };
  const line = (name: Name, label: string, colour: number, factor = 1): Line => ({
    name: label,
    colour,
    values: x.map((time) => {
      const value = mean_at(time, name);
      return value === null ? null : factor * value;
    }),
  });
  const depths = (of: 'median' | 'mean'): Line[] => [
    line(`core_depth_error_${of}`, 'In the core', 1, 100),
    line(`masked_depth_error_${of}`, 'In the mask', 2, 100),
    line(`outside_depth_error_${of}`, 'Outside', 3, 100),
  ];
  const psnr = [
    line('core_psnr', 'In the core', 1),
    line('masked_psnr', 'In the mask', 2),
    line('psnr', 'Whole picture', 3),
  ];
  const normals = [line('masked_normal_mae_deg', 'In the mask', 2), line('normal_mae_deg', 'Whole picture', 3)];
  return [
    chart('time-psnr', 'PSNR', x, psnr, 2, ' dB'),
    { ...chart('time-normals', 'Normal error', x, normals, 1, '°'), from_zero: true },
    { ...chart('time-depth-median', 'Depth error, median', x, depths('median'), 2, ' %'), from_zero: true },
    { ...chart('time-depth-mean', 'Depth error, mean', x, depths('mean'), 2, ' %'), from_zero: true },
  ];
}

export const name_of = ({ object }: ObjectMotion): string => `Object ${object}`;

const colours = 7;

function charts_of_motion(objects: readonly ObjectMotion[]): Chart[] {
  const followed = objects.filter(({ curve }) => curve.length > 0);
  // All curves have the same times.
  const x = followed[0]?.curve.map(({ time }) => time) ?? [];
  const lines = (key: 'share' | 'rotation_error_deg' | 'scale'): Line[] =>
    followed.map((o, i) => ({ name: name_of(o), colour: 1 + (i % colours), values: o.curve.map((m) => m[key]) }));
  // Only where it says something: rigid things have one scale.
  const true_scales = followed
    .map((o, i) => ({
      name: `${name_of(o)}, true`,
      colour: 1 + (i % colours),
      values: o.curve.map((m) => m.true_scale),
      dashed: true,
    }))
    .filter(({ values }) => values.some((value) => value !== null && Math.abs(value - 1) > 0.005));
  return [
    { ...chart('motion-error', 'Motion error', x, lines('share'), 3), from_zero: true },
    { ...chart('motion-rotation', 'Rotation error', x, lines('rotation_error_deg'), 1, '°'), from_zero: true },
    chart('motion-scale', 'Scale', x, [...lines('scale'), ...true_scales], 3),
  ];
}

export function charts_over_time({ views, motion }: ReportData): Chart[] {
  return [...charts_of_views(views), ...charts_of_motion(motion?.objects ?? [])].filter(is_seen);
}
