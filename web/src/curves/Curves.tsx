import type { TrainingEvent } from '../messages.ts';

export function Curves({ events }: { events: readonly TrainingEvent[] }) {
  return <p class="hint">{events.length} events</p>;
}
