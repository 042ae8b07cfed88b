import { comparing, shown, split_at } from '../state/store.ts';
import { clamp } from '../math/vec.ts';

// The handle between photograph (left) and render (right), where the canvas is split.
export function SplitSlider() {
  const place = shown.value?.photo ? shown.value.place : null;
  if (comparing.value !== 'split' || !place) return null;
  const set = (share: number): void => void (split_at.value = clamp(share, 0, 1));
  const drag = (event: PointerEvent & { currentTarget: HTMLElement }): void => {
    if (!event.currentTarget.hasPointerCapture(event.pointerId)) return;
    const box = event.currentTarget.parentElement?.getBoundingClientRect();
    if (box) set((event.clientX - box.left) / box.width);
  };
  const key = (event: KeyboardEvent): void => {
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02, PageDown: -0.1, PageUp: 0.1 }[event.key];
    const end = { Home: 0, End: 1 }[event.key];
    if (step === undefined && end === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    set(end ?? split_at.value + (step ?? 0));
  };
  const { left, top, width, height } = place;
  return (
    <div class="split" style={{ left: `${left}px`, top: `${top}px`, width: `${width}px`, height: `${height}px` }}>
      <span class="split-label start">Photograph</span>
      <span class="split-label end">Render</span>
      <div
        class="split-handle"
        role="slider"
        tabIndex={0}
        aria-label="Share of the picture that shows the photograph"
        aria-valuemin={0}
        aria-valuemax={100}
        aria-valuenow={Math.round(split_at.value * 100)}
        data-testid="split"
        style={{ left: `${split_at.value * 100}%` }}
        onPointerDown={(event) => event.currentTarget.setPointerCapture(event.pointerId)}
        onPointerMove={drag}
        onKeyDown={key}
      />
    </div>
  );
}
