import { mkdir, readFile, writeFile } from 'node:fs/promises';
import { dirname } from 'node:path';
import type { Figures, MotionFigures, ObjectMotion, ReportData } from '../src/report/data.ts';
import { png } from './png.ts';
import { captured_cameras } from './scene.ts';
import { render } from './tracer.ts';
import { Training } from './training.ts';

// Fills page/report.html with made-up data: node .build/dev/sample_report.js FILE

const [file = 'out/report.html'] = process.argv.slice(2);
const wave = (i: number, k: number): number => Math.sin(i * 1.7 + k * 2.3);

const figures = (i: number): Figures => ({
  psnr: 22.4 + 1.3 * wave(i, 0),
  ssim: 0.795 + 0.03 * wave(i, 1),
  lpips: 0.21 - 0.03 * wave(i, 0),
  lpips_published: null,
  masked_psnr: 16.3 + wave(i, 2),
  masked_ssim: 0.29 + 0.05 * wave(i, 3),
  core_psnr: 19.1 + wave(i, 2),
  normal_mae_deg: i % 7 === 5 ? null : 31 + 2 * wave(i, 4),
  masked_normal_mae_deg: null,
  masked_depth_error_median: 0.03 + 0.01 * wave(i, 5),
  masked_depth_error_mean: 0.05 + 0.01 * wave(i, 5),
  core_depth_error_median: 0.02 + 0.01 * wave(i, 6),
  core_depth_error_mean: 0.03 + 0.01 * wave(i, 6),
  outside_depth_error_median: 0.004 + 0.001 * wave(i, 7),
  outside_depth_error_mean: 0.01 + 0.001 * wave(i, 7),
});

// A thing that moves steadily, and that surfels follow less and less.
function object(id: number, drift: number): ObjectMotion {
  const at = (time: number): MotionFigures => ({
    moved: 0.3 * time,
    missed: 0.3 * drift * time * time,
    share: 1.8 * drift * time * time,
    rotation_error_deg: 40 * drift * time,
    scale: 1 + 0.2 * drift * time,
    true_scale: 1,
  });
  const curve = Array.from({ length: 80 }, (_, i) => ({ time: i / 79, ...at(i / 79) }));
  return { object: id, points: 120 * id, followed_points: 113 * id, ...at(0.56), curve };
}

const layers = ['photograph', 'rgb', 'difference', 'diffuse', 'specular', 'normal', 'depth'] as const;
const [width, height] = [360, 202];

async function pictures(): Promise<ReportData['pictures']> {
  const made: ReportData['pictures'] = [];
  for (const view of captured_cameras.test.filter((_, i) => i % 4 === 0)) {
    const drawn = await Promise.all(
      layers.map(async (layer) => {
        const rows = await render(view, view.time, width, height, { layer, exposure: 0, map: 'viridis' });
        const address = `data:image/png;base64,${png(rows ?? Buffer.alloc(0), width, height).toString('base64')}`;
        return [layer, address] as const;
      }),
    );
    made.push({
      id: view.id,
      width,
      height,
      ...(Object.fromEntries(drawn) as Record<(typeof layers)[number], string>),
    });
  }
  return made;
}

const setting = (path: string, value: string, usual: string, unit: string, help: string) => ({
  path,
  value,
  default: usual,
  unit,
  help,
});
const ops: [string, number][] = [
  ['raster backward', 0.31],
  ['raster', 0.2],
  ['trace backward', 0.14],
  ['trace', 0.12],
  ['field backward', 0.08],
  ['loss', 0.06],
  ['field', 0.05],
  ['adam', 0.03],
];

const training = new Training();
const events = training.begin();
while (!training.over) events.push(...training.advance());
const phase = (name: string, first: number, last: number, seconds: number) => ({
  name,
  first,
  last,
  seconds,
  steps: ops.map(([op, share]) => ({ name: op, calls: last - first, seconds: seconds * share })),
});

const data: ReportData = {
  version: '0.7.0',
  made: '2026-11-22T05:30:00Z',
  run: 'kettle-spheres',
  capture: 'kettle',
  split: 'test',
  downscale: 2,
  device: 'cpu',
  machine: { processor: 'AMD EPYC 7B13', threads: 2, memory_bytes: 24e9, system: 'Debian 12', gpu: '' },
  iterations: 8000,
  train_seconds: 717.4,
  render_fps: 14.2,
  surfels: { main: 20000, environment: 8443, per_masked_pixel: 1.21 },
  mean: { ...figures(0.4), psnr: 22.42 },
  motion: { mean: object(1, 0.15), objects: [object(1, 0.1), object(2, 0.3)] },
  views: captured_cameras.test.map((view, i) => ({ id: view.id, time: view.time, ...figures(i) })),
  settings: [
    setting('schedule.iterations', '8000', '60000', '', 'Iterations of the whole training'),
    setting('schedule.diffuse', '1200', '3000', '', 'Iteration at which the field begins to move'),
    setting('surfels.most', '20000', '400000', '', 'No set grows beyond this number of surfels'),
    setting('loss.ssim', '0.2', '0.2', '', 'Weight of 1 − SSIM'),
    setting('loss.normal', '0.05', '0.05', '', 'Weight of the agreement of normals with the normals of depth'),
    setting('loss.normal_prior', '0.02', '0.02', '', 'Weight of the agreement of normals with the prior'),
    setting('density.every', '80', '100', 'iterations', 'Pause between two changes of density'),
    setting('density.gradient', '0.0002', '0.0002', '', 'Mean gradient from which a surfel is cloned or split'),
    setting('trace.hits', '64', '64', '', 'Surfels that a mirrored ray blends at most'),
    setting('raster.low_pass', '0.707', '0.707', 'pixels', 'Radius of the screen-space low-pass'),
  ],
  phases: [
    phase('static', 0, 1200, 52),
    phase('diffuse', 1200, 3000, 140),
    phase('specular', 3000, 4400, 171),
    phase('joint', 4400, 8000, 354),
  ],
  events,
  pictures: await pictures(),
};

const page = await readFile(new URL('../../page/report.html', import.meta.url), 'utf8');
const text = JSON.stringify(data).replaceAll('<', '\\u003c');
await mkdir(dirname(file), { recursive: true });
await writeFile(
  file,
  page.replace(/(id="report">)null(<)/, (_, before: string, after: string) => before + text + after),
);
