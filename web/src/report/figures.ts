import type { Figures, ReportData } from './data.ts';

// What is known of each figure: how it is called and written, and which way is better.

export interface Kind {
  key: keyof Figures;
  label: string;
  unit: string;
  digits: number;
  factor?: number; // of what is written
  higher_is_better: boolean;
  in_table_alone?: boolean; // not at the head of the page
}

const kinds: Kind[] = [
  { key: 'psnr', label: 'PSNR', unit: 'dB', digits: 2, higher_is_better: true },
  { key: 'ssim', label: 'SSIM', unit: '', digits: 4, higher_is_better: true },
  { key: 'lpips', label: 'LPIPS', unit: '', digits: 4, higher_is_better: false },
  { key: 'lpips_published', label: 'LPIPS, as published', unit: '', digits: 4, higher_is_better: false },
  { key: 'masked_psnr', label: 'PSNR in the mask', unit: 'dB', digits: 2, higher_is_better: true },
  { key: 'masked_ssim', label: 'SSIM in the mask', unit: '', digits: 4, higher_is_better: true },
  { key: 'core_psnr', label: 'PSNR in the core', unit: 'dB', digits: 2, higher_is_better: true },
  { key: 'normal_mae_deg', label: 'Normal error', unit: '°', digits: 1, higher_is_better: false },
  { key: 'masked_normal_mae_deg', label: 'Normal error in the mask', unit: '°', digits: 1, higher_is_better: false },
  depth('masked_depth_error_median', 'Depth error in the mask', 'median'),
  depth('core_depth_error_median', 'Depth error in the core', 'median'),
  depth('outside_depth_error_median', 'Depth error outside', 'median'),
  depth('masked_depth_error_mean', 'Depth error in the mask', 'mean'),
  depth('core_depth_error_mean', 'Depth error in the core', 'mean'),
  depth('outside_depth_error_mean', 'Depth error outside', 'mean'),
];

function depth(key: Kind['key'], label: string, of: 'median' | 'mean'): Kind {
  const kind: Kind = { key, label, unit: `%, ${of}`, digits: 2, factor: 100, higher_is_better: false };
  return of === 'mean' ? { ...kind, in_table_alone: true } : kind;
}

export type View = ReportData['views'][number];

// The figures that this report has at all.
export const present = (data: ReportData): Kind[] =>
  kinds.filter(({ key }) => data.mean[key] !== null || data.views.some((view) => view[key] !== null));

export const written = (value: number | null, { digits, factor = 1 }: Kind): string =>
  value === null ? '–' : (factor * value).toFixed(digits);

// The best and the worst value among the views; null where they do not differ.
export function ends(views: readonly View[], { key, higher_is_better }: Kind): { best: number; worst: number } | null {
  const values = views.map((view) => view[key]).filter((value) => value !== null);
  const low = Math.min(...values);
  const high = Math.max(...values);
  if (values.length < 2 || low === high) return null;
  return higher_is_better ? { best: high, worst: low } : { best: low, worst: high };
}

export type Order = { by: keyof Figures | 'id' | 'time'; falling: boolean };

// Views without the figure come last, whichever way the others go.
export function sorted(views: readonly View[], { by, falling }: Order): View[] {
  const sign = falling ? -1 : 1;
  return [...views].sort((a, b) => {
    const [x, y] = [a[by], b[by]];
    if (x === null || y === null) return Number(x === null) - Number(y === null);
    return typeof x === 'string' || typeof y === 'string' ? sign * String(x).localeCompare(String(y)) : sign * (x - y);
  });
}
