import type { CapturedView, Vec3 } from '../src/messages.ts';
import { look_at } from '../src/math/camera.ts';

export const start: Vec3 = [0.4, -2.6, 1.35];

function view(index: number, count: number, side: 'left' | 'right'): CapturedView {
  const t = index / (count - 1);
  const angle = -1.9 + 1.1 * Math.sin(t * 5) + (side === 'right' ? 0.14 : 0);
  const position: Vec3 = [2.5 * Math.cos(angle), 2.5 * Math.sin(angle), 1.05 + 0.35 * Math.cos(t * 8)];
  const camera = look_at(position, [0, 0, 0.3], [0, 0, 1], 33);
  return { ...camera, id: `${String(index).padStart(6, '0')}_${side}`, time: t, width: 480, height: 270 };
}

const count = 80;
const all = Array.from({ length: count }, (_, i) => i);
export const captured_cameras = {
  train: all.map((i) => view(i, count, 'left')),
  test: all.filter((i) => i % 4 === 2).map((i) => view(i, count, 'right')),
};
