import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Chart } from '../../src/curves/charts.ts';
import type { Figures, MotionFigures, ObjectMotion, ReportData } from '../../src/report/data.ts';
import { charts_over_time } from '../../src/report/over_time.ts';

const none: Figures = {
  psnr: null,
  ssim: null,
  lpips: null,
  lpips_published: null,
  masked_psnr: null,
  masked_ssim: null,
  core_psnr: null,
  normal_mae_deg: null,
  masked_normal_mae_deg: null,
  masked_depth_error_median: null,
  masked_depth_error_mean: null,
  core_depth_error_median: null,
  core_depth_error_mean: null,
  outside_depth_error_median: null,
  outside_depth_error_mean: null,
};
const view = (time: number, figures: Partial<Figures>) => ({ id: `${time}`, time, ...none, ...figures });

const moment = (time: number, share: number, true_scale: number) => ({
  time,
  moved: 1,
  missed: share,
  share,
  rotation_error_deg: 10 * time,
  scale: 1 + time,
  true_scale,
});
const object = (id: number, curve: ObjectMotion['curve']): ObjectMotion => {
  const figures: MotionFigures = { moved: 1, missed: 1, share: 1, rotation_error_deg: 1, scale: 1, true_scale: 1 };
  return { object: id, points: 9, followed_points: 9, ...figures, curve };
};

const charts = (views: ReportData['views'], objects: ObjectMotion[] = []): Map<string, Chart> => {
  const motion = objects[0] ? { mean: objects[0], objects } : null;
  return new Map(charts_over_time({ views, motion } as ReportData).map((chart) => [chart.id, chart]));
};
const values = (chart: Chart | undefined, name: string) => chart?.lines.find((line) => line.name === name)?.values;

test('figures are drawn in the order of time, those of one time together', () => {
  const found = charts([
    view(1, { psnr: 30, core_psnr: 20 }),
    view(0, { psnr: 10 }),
    view(0.5, { psnr: 20, core_psnr: 8 }),
    view(0.5, { psnr: 22 }),
  ]).get('time-psnr');
  assert.deepEqual(found?.x, [0, 0.5, 1]);
  assert.deepEqual(values(found, 'Whole picture'), [10, 21, 30]);
  assert.deepEqual(values(found, 'In the core'), [null, 8, 20]);
  assert.equal(values(found, 'In the mask'), undefined);
  assert.equal(found?.over, 'time');
});

test('depth errors are percentages', () => {
  const found = charts([view(0, { core_depth_error_median: 0.5 }), view(1, { core_depth_error_median: 0.25 })]);
  assert.deepEqual(values(found.get('time-depth-median'), 'In the core'), [50, 25]);
  assert.equal(found.has('time-depth-mean'), false);
});

test('what one time alone has is not drawn', () => {
  assert.equal(charts([view(0, { psnr: 1 })]).size, 0);
  assert.equal(charts([view(0.5, { psnr: 1 }), view(0.5, { psnr: 2 })]).size, 0);
  assert.equal(charts([view(0, { psnr: 1 }), view(1, {})]).size, 0);
});

test('motion has a line for each object that is followed', () => {
  const found = charts([], [
    object(2, [moment(0, 0, 1), moment(1, 0.5, 1)]),
    object(5, []),
    object(7, [moment(0, 0, 1), moment(1, 0.25, 1.2)]),
  ]);
  assert.deepEqual([...found.keys()], ['motion-error', 'motion-rotation', 'motion-scale']);
  const error = found.get('motion-error');
  assert.deepEqual(error?.lines.map(({ name }) => name), ['Object 2', 'Object 7']);
  assert.deepEqual(values(error, 'Object 7'), [0, 0.25]);
  assert.deepEqual(values(found.get('motion-rotation'), 'Object 2'), [0, 10]);
  const scale = found.get('motion-scale');
  assert.deepEqual(scale?.lines.map(({ name }) => name), ['Object 2', 'Object 7', 'Object 7, true']);
  assert.equal(scale?.lines[2]?.dashed, true);
});
