import { useState } from 'preact/hooks';
import { clamp } from '../math/vec.ts';

interface CompareProps {
  left: string; // addresses of the pictures
  right: string;
  leftName: string;
  rightName: string;
  aspect: number;
  id: string;
}

// Two pictures of one view, parted by a line that can be dragged.
export function Compare({ left, right, leftName, rightName, aspect, id }: CompareProps) {
  const [share, set_share] = useState(0.5);
  const drag = (event: PointerEvent & { currentTarget: HTMLElement }): void => {
    if (event.type === 'pointerdown') event.currentTarget.setPointerCapture(event.pointerId);
    else if (!event.currentTarget.hasPointerCapture(event.pointerId)) return;
    const box = event.currentTarget.getBoundingClientRect();
    set_share(clamp((event.clientX - box.left) / box.width, 0, 1));
  };
  const key = (event: KeyboardEvent): void => {
    const by = { ArrowLeft: -0.02, ArrowRight: 0.02, Home: -1, End: 1 }[event.key];
    if (by === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    set_share((s) => clamp(s + by, 0, 1));
  };
  return (
    <div
      class="compare"
      style={{ aspectRatio: String(aspect) }}
      onPointerDown={drag}
      onPointerMove={drag}
      data-testid={`${id}-compare`}
    >
      <img src={right} alt={rightName} draggable={false} />
      <img src={left} alt={leftName} draggable={false} style={{ clipPath: `inset(0 ${(1 - share) * 100}% 0 0)` }} />
      <span class="compare-name start">{leftName}</span>
      <span class="compare-name end">{rightName}</span>
      <div
        class="compare-handle"
        role="slider"
        tabIndex={0}
        aria-label={`Share of the picture that shows: ${leftName}`}
        aria-valuemin={0}
        aria-valuemax={100}
        aria-valuenow={Math.round(share * 100)}
        data-testid={`${id}-handle`}
        style={{ left: `${share * 100}%` }}
        onKeyDown={key}
      />
    </div>
  );
}
