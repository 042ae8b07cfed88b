import { signal } from '@preact/signals';
import type { FrameHeader } from '../messages.ts';
import '../for_tests.ts';
import { link } from '../state/store.ts';
import type { SentView } from './view_requester.ts';

// How the pictures come: what the status line shows and what tests read.

export interface Measures {
  width: number;
  height: number;
  milliseconds: number;
  rate: number; // frames in the last second
  latency: number; // ms from input to the first frame that shows it, median of the last ones
  final: boolean;
}

export const measures = signal<Measures | null>(null);

const kept = 1000;
const arrivals: number[] = [];
const recent: number[] = [];

window.traceflow = {
  frames: 0,
  lastFrame: null,
  latencies: [],
  get connected() {
    return link.value.kind === 'open';
  },
};

// A frame has been painted; `answered` if it is the first that shows this view.
export function count_frame(header: FrameHeader, answered: SentView | undefined): void {
  const now = performance.now();
  const { view, width, height, final, milliseconds } = header;
  window.traceflow.frames++;
  window.traceflow.lastFrame = { view, width, height, final };
  if (answered) {
    keep(window.traceflow.latencies, now - answered.input, kept);
    keep(recent, now - answered.input, 9);
  }
  arrivals.push(now);
  while ((arrivals[0] ?? now) < now - 1000) arrivals.shift();
  measures.value = { width, height, milliseconds, rate: arrivals.length, latency: median(recent), final };
}

function keep(list: number[], value: number, limit: number): void {
  list.push(value);
  if (list.length > limit) list.shift();
}

function median(list: readonly number[]): number {
  return [...list].sort((a, b) => a - b)[list.length >> 1] ?? 0;
}
