import { useEffect, useRef } from 'preact/hooks';
import { hello, pixel_ratio, rays_on, shown, stage } from '../state/store.ts';
import { find_surface, hover, hovered, in_picture, pin } from '../state/rays.ts';
import { listen_to_pointers } from './gestures.ts';
import { listen_to_keys } from './keys.ts';
import { use_canvas } from './pictures.ts';
import { centre_on } from './travel.ts';
import { Overlay } from './Overlay.tsx';
import { RayReadout } from './RayReadout.tsx';
import { SplitSlider } from './SplitSlider.tsx';
import { StatusLine } from './StatusLine.tsx';
import { Timeline } from './Timeline.tsx';
import { Tools } from './Tools.tsx';

// The picture, as large as can be, and what lies over it.
export function Stage() {
  const frame = useRef<HTMLDivElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    if (!frame.current || !canvas.current) return;
    use_canvas(canvas.current);
    const stop_measuring = measure(frame.current);
    const stop_keys = listen_to_keys();
    const stop_pointers = listen_to_pointers(canvas.current, {
      tap(x, y, event) {
        const point = in_picture(x, y);
        if (!rays_on.value || !point) return;
        if (event.pointerType !== 'mouse') hover(point);
        pin(point);
      },
      double_tap(x, y) {
        const point = in_picture(x, y);
        if (point && !rays_on.value) find_surface(point, (ray) => centre_on(ray.surface));
      },
      hover: (x, y) => hover(in_picture(x, y)),
      leave: () => hover(null),
    });
    return () => {
      stop_measuring();
      stop_keys();
      stop_pointers();
    };
  }, []);

  return (
    <main class={rays_on.value ? 'stage tool-rays' : 'stage'} ref={frame}>
      <canvas
        ref={canvas}
        class="picture"
        tabIndex={0}
        role="application"
        aria-label="The scene. Drag or use the arrow keys to look around; press ? for all keys."
        data-testid="stage"
      />
      {shown.value && <Overlay />}
      {!shown.value && <p class="stage-wait">{hello.value ? 'The first picture is being made…' : ''}</p>}
      <SplitSlider />
      <Tools />
      <StatusLine />
      {hovered.value && <RayReadout ray={hovered.value} />}
      <Timeline />
    </main>
  );
}

function measure(element: HTMLElement): () => void {
  const take = (): void => {
    pixel_ratio.value = Math.min(window.devicePixelRatio, 2);
    stage.value = { width: element.clientWidth, height: element.clientHeight };
  };
  const observer = new ResizeObserver(take);
  observer.observe(element);
  take();
  return () => observer.disconnect();
}
