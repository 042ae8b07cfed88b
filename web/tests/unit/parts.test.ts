import assert from 'node:assert/strict';
import { test } from 'node:test';
import { fit, whole } from '../../src/math/fit.ts';
import { pause_before } from '../../src/net/connection.ts';
import { parse_picture } from '../../src/net/wire.ts';
import { bytes, count, duration, figure, file_name, short_count, signed, title } from '../../src/parts/format.ts';
import { ends, sorted, written, type Kind, type View } from '../../src/report/figures.ts';

function message(header: object, body: number[], claimed?: number): ArrayBuffer {
  const text = new TextEncoder().encode(JSON.stringify(header));
  const data = new Uint8Array(4 + text.length + body.length);
  new DataView(data.buffer).setUint32(0, claimed ?? text.length, true);
  data.set(text, 4);
  data.set(body, 4 + text.length);
  return data.buffer;
}

test('a binary message is a header and a picture', () => {
  const picture = parse_picture(message({ type: 'frame', frame: 3 }, [1, 2, 3]));
  assert.equal(picture.header.type, 'frame');
  assert.deepEqual([...picture.bytes], [1, 2, 3]);
});

test('a message that is cut off is refused', () => {
  assert.throws(() => parse_picture(new ArrayBuffer(3)), /without a header/);
  assert.throws(() => parse_picture(message({}, [], 4000)), /cut off/);
});

test('pauses grow up to five seconds', () => {
  assert.deepEqual([0, 1, 2, 3, 4, 99].map(pause_before), [500, 1000, 2000, 3500, 5000, 5000]);
});

test('numbers are written for people', () => {
  assert.equal(count(1234567), '1,234,567');
  assert.equal(count(999), '999');
  assert.equal(short_count(9999), '9,999');
  assert.equal(short_count(12345), '12.3k');
  assert.equal(short_count(2.5e6), '2.50M');
  assert.deepEqual([0.000012, 0.1234567, 1.23456, 12.3456, 123.456, 0, NaN].map(figure), [
    '1.20e-5',
    '0.1235',
    '1.235',
    '12.35',
    '123.5',
    '0',
    '–',
  ]);
  assert.deepEqual([0.25, 4.2, 42, 65, 3725, 7199].map(duration), [
    '250 ms',
    '4.2 s',
    '42 s',
    '1 min 5 s',
    '1 h 2 min',
    '2 h 0 min',
  ]);
  assert.deepEqual([999, 1500, 1.9e9, 24e9].map(bytes), ['999 B', '1.50 kB', '1.90 GB', '24.0 GB']);
  assert.equal(signed(-0.5, 1), '−0.5');
  assert.equal(title('median-depth'), 'Median depth');
  assert.equal(title('ssim'), 'SSIM');
  assert.equal(file_name('../a b/ü.ply'), 'a-b-.ply');
  assert.equal(file_name('///'), 'traceflow');
});

test('pictures are fitted into the middle', () => {
  assert.deepEqual(fit(2, { width: 100, height: 100 }), { left: 0, top: 25, width: 100, height: 50 });
  assert.deepEqual(fit(0.5, { width: 100, height: 100 }), { left: 25, top: 0, width: 50, height: 100 });
  assert.deepEqual(whole({ width: 0.2, height: 7.6 }, 4096), { width: 1, height: 8 });
  assert.deepEqual(whole({ width: 5120, height: 2880 }, 4096), { width: 4096, height: 2304 });
  assert.deepEqual(whole({ width: 1000, height: 9000 }, 4096), { width: 455, height: 4096 });
});

const kind: Kind = { key: 'lpips', label: '', unit: '', digits: 2, higher_is_better: false };
const view = (id: string, lpips: number | null): View => ({
  id,
  time: 0,
  lpips,
  psnr: null,
  ssim: null,
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
});

test('shares are written as percentages', () => {
  assert.equal(written(0.01234, { ...kind, factor: 100 }), '1.23');
  assert.equal(written(0.01234, kind), '0.01');
  assert.equal(written(null, { ...kind, factor: 100 }), '–');
});

test('views are sorted with the unknown last', () => {
  const views = [view('b', 0.2), view('c', null), view('a', 0.1)];
  assert.deepEqual(
    sorted(views, { by: 'lpips', falling: false }).map((v) => v.id),
    ['a', 'b', 'c'],
  );
  assert.deepEqual(
    sorted(views, { by: 'lpips', falling: true }).map((v) => v.id),
    ['b', 'a', 'c'],
  );
  assert.deepEqual(
    sorted(views, { by: 'id', falling: true }).map((v) => v.id),
    ['c', 'b', 'a'],
  );
  assert.deepEqual(ends(views, kind), { best: 0.1, worst: 0.2 });
  assert.equal(ends([view('a', 0.1), view('b', 0.1)], kind), null);
});
