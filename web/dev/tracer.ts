import type { Camera, ProbeReply, Vec3 } from '../src/messages.ts';
import { forward_of, radians } from '../src/math/camera.ts';
import { apply } from '../src/math/rotation.ts';
import { add, add_scaled, distance, dot, mix, scale, subtract, unit } from '../src/math/vec.ts';

// A little scene to have something to look at: a mirror ball that hops on a chequered floor between coloured balls.

interface Ball {
  centre: Vec3;
  radius: number;
  colour: Vec3;
  tint: number;
}

interface Hit {
  at: number;
  normal: Vec3;
  colour: Vec3;
  tint: number;
}

const sun = unit([0.5, 0.4, 0.9]);

export function balls(time: number): Ball[] {
  const hop = Math.abs(Math.sin(time * Math.PI * 3)) * 0.28;
  return [
    { centre: [0, 0, 0.3 + hop], radius: 0.3, colour: [0.75, 0.76, 0.8], tint: 0.85 },
    {
      centre: [0.75 * Math.cos(time * 6.2832), 0.75 * Math.sin(time * 6.2832), 0.16],
      radius: 0.16,
      colour: [0.93, 0.45, 0.16],
      tint: 0.1,
    },
    { centre: [-0.75, 0.3, 0.2], radius: 0.2, colour: [0.35, 0.68, 0.42], tint: 0.15 },
    { centre: [0.35, 0.85, 0.25], radius: 0.25, colour: [0.8, 0.3, 0.34], tint: 0.05 },
    { centre: [-0.45, -0.62, 0.12], radius: 0.12, colour: [0.28, 0.45, 0.8], tint: 0.3 },
  ];
}

function nearest(scene: Ball[], from: Vec3, along: Vec3): Hit | null {
  let best: Hit | null = null;
  for (const ball of scene) {
    const offset = subtract(from, ball.centre);
    const b = dot(offset, along);
    const root = b * b - dot(offset, offset) + ball.radius * ball.radius;
    if (root < 0) continue;
    const at = -b - Math.sqrt(root);
    if (at > 1e-4 && at < (best?.at ?? Infinity)) {
      const point = add_scaled(from, along, at);
      best = { at, normal: scale(subtract(point, ball.centre), 1 / ball.radius), colour: ball.colour, tint: ball.tint };
    }
  }
  const floor = -from[2] / along[2];
  if (floor > 1e-4 && floor < (best?.at ?? Infinity)) {
    const [x, y] = add_scaled(from, along, floor);
    if (Math.hypot(x, y) < 2.2) {
      const dark = (Math.floor(x * 4) + Math.floor(y * 4)) & 1;
      best = { at: floor, normal: [0, 0, 1], colour: dark ? [0.55, 0.42, 0.3] : [0.82, 0.72, 0.58], tint: 0.04 };
    }
  }
  return best;
}

function sky(along: Vec3): Vec3 {
  const t = Math.max(along[2], 0);
  const brick = Math.sin(Math.atan2(along[1], along[0]) * 14) > 0 && along[2] < 0.35 ? 0.86 : 1;
  return scale(mix([0.78, 0.66, 0.58], [0.42, 0.55, 0.75], Math.sqrt(t)), brick);
}

const mirrored = (along: Vec3, normal: Vec3): Vec3 => add_scaled(along, normal, -2 * dot(along, normal));

function lit(scene: Ball[], point: Vec3, hit: Hit): Vec3 {
  const open = nearest(scene, add_scaled(point, hit.normal, 1e-3), sun) ? 0.35 : 1;
  return scale(hit.colour, 0.35 + 0.65 * open * Math.max(dot(hit.normal, sun), 0));
}

export interface Sample {
  hit: Hit | null;
  depth: number;
  diffuse: Vec3;
  specular: Vec3;
  colour: Vec3;
}

export function sample(scene: Ball[], from: Vec3, along: Vec3, forward: Vec3): Sample {
  const hit = nearest(scene, from, along);
  if (!hit) return { hit, depth: 0, diffuse: sky(along), specular: [0, 0, 0], colour: sky(along) };
  const point = add_scaled(from, along, hit.at);
  const diffuse = lit(scene, point, hit);
  let specular: Vec3 = [0, 0, 0];
  if (hit.tint > 0.05) {
    const out = mirrored(along, hit.normal);
    const start = add_scaled(point, hit.normal, 1e-3);
    const next = nearest(scene, start, out);
    specular = next ? lit(scene, add_scaled(start, out, next.at), next) : sky(out);
  }
  return { hit, depth: hit.at * dot(along, forward), diffuse, specular, colour: mix(diffuse, specular, hit.tint) };
}

const turbo = (t: number): Vec3 => [
  Math.min(1, Math.max(0, 1.5 - Math.abs(4 * t - 3))),
  Math.min(1, Math.max(0, 1.5 - Math.abs(4 * t - 2))),
  Math.min(1, Math.max(0, 1.5 - Math.abs(4 * t - 1))),
];
const maps: Record<string, (t: number) => Vec3> = {
  viridis: (t) => [0.27 + 0.7 * t * t, 0.02 + 0.88 * t, 0.33 + 0.5 * t - 0.75 * t * t],
  turbo,
  grey: (t) => [t, t, t],
};

export interface Wanted {
  layer: string;
  exposure: number;
  map: string;
}

function pixel(s: Sample, { layer, exposure, map }: Wanted, x: number, y: number): Vec3 {
  const gain = 2 ** exposure;
  const number = (t: number): Vec3 => (maps[map] ?? turbo)(Math.min(Math.max(t, 0), 1));
  const noise = ((Math.sin(x * 12.9898 + y * 78.233) * 43758.5453) % 1) * 0.06;
  switch (layer) {
    case 'diffuse':
      return scale(s.diffuse, gain);
    case 'specular':
      return scale(s.specular, gain);
    case 'tint':
      return number(s.hit?.tint ?? 0);
    case 'alpha':
      return number(s.hit ? 1 : 0.3);
    case 'normal':
      return s.hit ? add(scale(s.hit.normal, 0.5), [0.5, 0.5, 0.5]) : [0, 0, 0];
    case 'depth':
      return number(s.hit ? 1 - s.depth / 4 : 0);
    case 'median-depth':
      return number(s.hit ? 1 - s.depth / 4.4 : 0);
    case 'distortion':
      return number(s.hit ? Math.abs(noise) * 10 : 0);
    case 'difference':
      return scale([Math.abs(noise) * 3, Math.abs(noise) * 2, s.hit ? s.hit.tint * 0.3 : 0], gain);
    case 'surfels': {
      const cell = Math.sin(s.depth * 90 + x * 0.2) * Math.sin(y * 0.25) > 0.2 ? 1 : 0.55;
      return scale(s.colour, cell * gain);
    }
    case 'tracks': {
      const is_dot = s.hit && x % 12 < 2 && y % 12 < 2;
      return is_dot ? turbo((x % 240) / 240) : scale(s.colour, gain);
    }
    case 'photograph':
      return scale(add(s.colour, [noise, noise, noise]), 1.04);
    default:
      return scale(s.colour, gain);
  }
}

// 8 bit RGB rows. Lets others work in between; null once `is_stale`.
export async function render(
  camera: Camera,
  time: number,
  width: number,
  height: number,
  wanted: Wanted,
  is_stale: () => boolean = () => false,
): Promise<Buffer | null> {
  const scene = balls(time);
  const forward = forward_of(camera);
  const h = Math.tan(radians(camera.fov_y) / 2);
  const out = Buffer.alloc(width * height * 3);
  for (let y = 0, i = 0; y < height; y++) {
    if (y % 16 === 15) await new Promise((done) => setImmediate(done));
    if (is_stale()) return null;
    for (let x = 0; x < width; x++) {
      const direction: Vec3 = [((2 * x + 1) / width - 1) * h * (width / height), ((2 * y + 1) / height - 1) * h, 1];
      const colour = pixel(
        sample(scene, camera.position, unit(apply(camera.rotation, direction)), forward),
        wanted,
        x,
        y,
      );
      for (const c of colour) out[i++] = Math.min(Math.max(c, 0), 1) ** (1 / 1.4) * 255;
    }
  }
  return out;
}

export function probe(camera: Camera, time: number, along: Vec3, id: number): ProbeReply {
  const scene = balls(time);
  const s = sample(scene, camera.position, along, forward_of(camera));
  if (!s.hit) return { type: 'probe', id, hit: false };
  const surface = add_scaled(camera.position, along, s.hit.at);
  const direction = mirrored(along, s.hit.normal);
  const start = add_scaled(surface, s.hit.normal, 1e-3);
  const next = nearest(scene, start, direction);
  const end = add_scaled(start, direction, next?.at ?? 3);
  return {
    type: 'probe',
    id,
    hit: true,
    surface,
    normal: s.hit.normal,
    depth: s.depth,
    alpha: 0.97,
    tint: s.hit.tint,
    colour: s.colour,
    diffuse: s.diffuse,
    specular: s.specular,
    mirrored: { direction, end, distance: next ? distance(surface, end) : 0, alpha: next ? 0.92 : 0 },
  };
}
