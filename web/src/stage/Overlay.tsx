import type { Camera, Vec3 } from '../messages.ts';
import { frustum, project, project_line, type Point } from '../math/camera.ts';
import { add_scaled, dot, scale, subtract } from '../math/vec.ts';
import { camera, hello, previewing, rays_on, shown, stage, type Shown } from '../state/store.ts';
import { hovered, pinned, type Ray } from '../state/rays.ts';
import { path, path_visible, shots } from '../state/path.ts';

// What is drawn into the scene over its picture, with the camera of the picture that is shown: rays and the camera
// path.
export function Overlay() {
  const view = shown.value;
  if (!view) return null;
  const { width, height } = stage.value;
  const rays =
    rays_on.value || pinned.value.length > 0 ? [...pinned.value, ...(hovered.value ? [hovered.value] : [])] : [];
  return (
    <svg class="overlay" width={width} height={height} aria-hidden="true" data-testid="overlay">
      {path_visible.value && !previewing.value && <PathLines view={view} />}
      {rays.map((ray) => (
        <RayLines key={ray.id} view={view} ray={ray} live={ray === hovered.value} />
      ))}
    </svg>
  );
}

const near = (): number => (hello.value?.extent ?? 1) * 1e-3;

function on_stage({ place }: Shown, { x, y }: Point): Point {
  return { x: place.left + x * place.width, y: place.top + y * place.height };
}

interface LineProps {
  view: Shown;
  from: Vec3;
  to: Vec3;
  kind: string;
}

function Line({ view, from, to, kind }: LineProps) {
  const ends = project_line(view.camera, view.aspect, from, to, near());
  if (!ends) return null;
  const a = on_stage(view, ends[0]);
  const b = on_stage(view, ends[1]);
  return <line class={kind} x1={a.x} y1={a.y} x2={b.x} y2={b.y} />;
}

function Dot({ view, at, kind, size }: { view: Shown; at: Vec3; kind: string; size: number }) {
  const point = project(view.camera, view.aspect, at);
  if (!point) return null;
  const { x, y } = on_stage(view, point);
  return <circle class={kind} cx={x} cy={y} r={size} />;
}

// The normal, the way back to the eye that a pinned ray was seen from, and the mirrored ray to where its light comes
// from; faint where it meets nothing.
function RayLines({ view, ray, live }: { view: Shown; ray: Ray; live: boolean }) {
  const extent = hello.value?.extent ?? 1;
  const { surface, normal, mirrored } = ray;
  const meets = mirrored !== undefined && mirrored.distance > 0;
  const end = mirrored && (meets ? mirrored.end : add_scaled(surface, mirrored.direction, extent));
  return (
    <g class={live ? 'ray live' : 'ray'}>
      {mirrored && !live && (
        <Line
          view={view}
          from={surface}
          to={add_scaled(surface, towards_eye(mirrored.direction, normal), extent)}
          kind="ray-seen"
        />
      )}
      {end && meets && <Line view={view} from={surface} to={end} kind="ray-halo" />}
      {end && <Line view={view} from={surface} to={end} kind={meets ? 'ray-mirrored' : 'ray-mirrored lost'} />}
      <Line view={view} from={surface} to={add_scaled(surface, normal, extent * 0.08)} kind="ray-halo" />
      <Line view={view} from={surface} to={add_scaled(surface, normal, extent * 0.08)} kind="ray-normal" />
      <Dot view={view} at={surface} kind="ray-surface" size={live ? 4 : 3.2} />
      {end && meets && <Dot view={view} at={end} kind="ray-end" size={live ? 4.5 : 3.6} />}
    </g>
  );
}

// Where the ray came from: its mirror image, mirrored back.
const towards_eye = (mirrored: Vec3, normal: Vec3): Vec3 =>
  subtract(scale(normal, 2 * dot(mirrored, normal)), mirrored);

// The way of the camera and a small pyramid for each keyframe.
function PathLines({ view }: { view: Shown }) {
  const { keyframes, width, height } = path.value;
  const size = (hello.value?.extent ?? 1) * 0.05;
  const way = shots.value;
  const every = Math.max(1, Math.floor(way.length / 240));
  const points = way.filter((_, i) => i % every === 0 || i === way.length - 1).map((shot) => shot.camera.position);
  return (
    <g class="path">
      {points.slice(1).map((to, i) => (
        <Line key={i} view={view} from={points[i] ?? to} to={to} kind="path-way" />
      ))}
      {keyframes.map((keyframe, i) => (
        <Pyramid key={`k${i}`} view={view} of={keyframe} aspect={width / height} size={size} />
      ))}
    </g>
  );
}

function Pyramid({ view, of, aspect, size }: { view: Shown; of: Camera; aspect: number; size: number }) {
  const here = camera.value;
  if (here && Math.hypot(...of.position.map((x, i) => x - (here.position[i] ?? 0))) < size) return null;
  const corners = frustum(of, aspect, size);
  return (
    <g>
      {corners.map((corner, i) => (
        <g key={i}>
          <Line view={view} from={of.position} to={corner} kind="path-key" />
          <Line view={view} from={corner} to={corners[(i + 1) % 4] ?? corner} kind="path-key" />
        </g>
      ))}
    </g>
  );
}
