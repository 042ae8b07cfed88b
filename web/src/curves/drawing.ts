import type uPlot from 'uplot';
import type { Density, Phase } from './series.ts';

// What lies under and beside the lines of a chart.

export const css_colour = (name: string): string =>
  getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// Phases as bands with their names, and opacity resets as dashed lines.
export function bands_plugin(phases: () => Phase[], marks: () => number[]): uPlot.Plugin {
  return {
    hooks: {
      drawClear: (u) => {
        const { ctx, bbox } = u;
        const ratio = devicePixelRatio;
        const place = (x: number): number =>
          Math.min(Math.max(u.valToPos(x, 'x', true), bbox.left), bbox.left + bbox.width);
        ctx.save();
        ctx.font = `${10 * ratio}px system-ui, sans-serif`;
        ctx.textAlign = 'left';
        ctx.textBaseline = 'top';
        phases().forEach(({ name, first, last }, i) => {
          const left = place(first);
          const width = place(last) - left;
          if (i % 2 === 0) {
            ctx.fillStyle = css_colour('--band');
            ctx.fillRect(left, bbox.top, width, bbox.height);
          }
          ctx.fillStyle = css_colour('--dim');
          if (ctx.measureText(name).width + 8 * ratio < width)
            ctx.fillText(name, left + 4 * ratio, bbox.top + 3 * ratio);
        });
        ctx.strokeStyle = css_colour('--dim');
        ctx.setLineDash([2 * ratio, 3 * ratio]);
        ctx.lineWidth = ratio;
        ctx.beginPath();
        for (const mark of marks()) {
          const x = Math.round(u.valToPos(mark, 'x', true)) + 0.5;
          ctx.moveTo(x, bbox.top);
          ctx.lineTo(x, bbox.top + bbox.height);
        }
        ctx.stroke();
        ctx.restore();
      },
    },
  };
}

// Changes of density as bars: cloned, split and added upwards, pruned downwards.
export function bars_plugin(density: () => Density | undefined): uPlot.Plugin {
  return {
    hooks: {
      draw: (u) => {
        const bars = density();
        if (!bars) return;
        const { ctx, bbox } = u;
        const space = bbox.width / Math.max(bars.iteration.length, 8);
        const width = Math.max(1, Math.min(space * 0.7, 10 * devicePixelRatio));
        ctx.save();
        ctx.beginPath();
        ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
        ctx.clip();
        const bar = (i: number, from: number, to: number, colour: number): void => {
          const x = u.valToPos(bars.iteration[i] ?? 0, 'x', true);
          const a = u.valToPos(from, 'y', true);
          const b = u.valToPos(to, 'y', true);
          ctx.fillStyle = css_colour(`--series-${colour}`);
          ctx.fillRect(x - width / 2, Math.min(a, b), width, Math.abs(b - a));
        };
        bars.iteration.forEach((_, i) => {
          const [cloned = 0, split = 0, added = 0, transparent = 0, large = 0] = [
            bars.cloned[i],
            bars.split[i],
            bars.added[i],
            bars.transparent[i],
            bars.large[i],
          ];
          bar(i, 0, cloned, 3);
          bar(i, cloned, cloned + split, 2);
          bar(i, cloned + split, cloned + split + added, 5);
          bar(i, 0, -transparent, 7);
          bar(i, -transparent, -transparent - large, 4);
        });
        ctx.restore();
      },
    },
  };
}
