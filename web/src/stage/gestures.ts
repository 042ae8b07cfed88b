import { look_around, orbit, pan, zoom, fly } from '../math/navigate.ts';
import { hello, mode, stage } from '../state/store.ts';
import { steer } from './travel.ts';

// Pointers on the stage: drags orbit (or look around), right, middle and shift drags and two fingers pan, the wheel and
// a pinch come nearer. A press that does not move is left to `tap`.

export interface Touches {
  tap(x: number, y: number, event: PointerEvent): void; // x, y in CSS pixels of the stage
  double_tap(x: number, y: number): void;
  hover(x: number, y: number): void;
  leave(): void;
}

const turn = 2.6; // radians for a drag over the stage's shorter side
const still = 5; // pixels that a tap may wander

const shorter = (): number => Math.min(stage.value.width, stage.value.height);

export function turn_by(dx: number, dy: number): void {
  const size = turn / shorter();
  // Orbiting takes hold of the scene, looking around turns the head.
  if (mode.value === 'orbit') steer((view, up) => orbit(view, up, dx * size, dy * size));
  else steer((view, up) => look_around(view, up, (dx * size) / 3, (dy * size) / 3));
}

export const pan_by = (dx: number, dy: number): void =>
  steer((view) => pan(view, dx / stage.value.height, dy / stage.value.height));

// factor < 1 comes nearer.
export function zoom_by(factor: number): void {
  const extent = hello.value?.extent ?? 1;
  if (mode.value === 'fly') steer((view, up) => fly(view, up, 0, 0, -Math.log(factor) * extent * 0.4));
  else steer((view) => zoom(view, factor, extent * 1e-3, extent * 50));
}

export function listen_to_pointers(element: HTMLElement, touches: Touches): () => void {
  const down = new Map<number, { x: number; y: number }>();
  let travelled = 0;
  let most = 0; // fingers at once since the first went down

  const at = (event: PointerEvent | MouseEvent | WheelEvent) => {
    const box = element.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  const spread = (): { x: number; y: number; size: number } => {
    const [a = { x: 0, y: 0 }, b = a] = [...down.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, size: Math.hypot(a.x - b.x, a.y - b.y) };
  };

  const press = (event: PointerEvent): void => {
    element.focus({ preventScroll: true });
    element.setPointerCapture(event.pointerId);
    if (down.size === 0) travelled = most = 0;
    down.set(event.pointerId, at(event));
    most = Math.max(most, down.size);
  };

  const move = (event: PointerEvent): void => {
    const now = at(event);
    const before = down.get(event.pointerId);
    if (!before) return touches.hover(now.x, now.y);
    const [dx, dy] = [now.x - before.x, now.y - before.y];
    travelled += Math.hypot(dx, dy);
    if (down.size >= 2) {
      const old = spread();
      down.set(event.pointerId, now);
      const after = spread();
      pan_by(after.x - old.x, after.y - old.y);
      if (old.size > 0 && after.size > 0) zoom_by(old.size / after.size);
      return;
    }
    if (travelled < still) return;
    down.set(event.pointerId, now);
    if (event.buttons & 6 || event.shiftKey) pan_by(dx, dy);
    else turn_by(dx, dy);
  };

  const release = (event: PointerEvent): void => {
    if (!down.delete(event.pointerId) || down.size > 0) return;
    const { x, y } = at(event);
    if (event.type === 'pointerup' && event.button === 0 && travelled < still && most === 1) touches.tap(x, y, event);
  };

  const roll = (event: WheelEvent): void => {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : 30;
    const strength = event.ctrlKey ? 0.01 : 0.0016; // a pinch on a touchpad comes as a wheel with ctrl
    zoom_by(Math.exp(Math.max(-200, Math.min(200, event.deltaY * lines)) * strength));
  };

  const double = (event: MouseEvent): void => {
    const { x, y } = at(event);
    touches.double_tap(x, y);
  };
  const menu = (event: Event): void => event.preventDefault();

  const listeners: [string, (event: never) => void][] = [
    ['pointerdown', press],
    ['pointermove', move],
    ['pointerup', release],
    ['pointercancel', release],
    // A finger that was lifted has left too, but what it touched stays of interest.
    ['pointerleave', (event: PointerEvent) => event.pointerType !== 'touch' && touches.leave()],
    ['wheel', roll],
    ['dblclick', double],
    ['contextmenu', menu],
  ];
  for (const [name, f] of listeners) element.addEventListener(name, f as EventListener, { passive: false });
  return () => {
    for (const [name, f] of listeners) element.removeEventListener(name, f as EventListener);
  };
}
