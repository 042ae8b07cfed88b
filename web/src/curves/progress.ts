import type { TrainingEvent } from '../messages.ts';

type Step = Extract<TrainingEvent, { event: 'step' }>;

export const latest_step = (events: readonly TrainingEvent[]): Step | undefined =>
  events.findLast((e): e is Step => e.event === 'step');

// Seconds that the rest of the training takes at the pace of the last tenth of it; null before there is a pace.
export function seconds_left(events: readonly TrainingEvent[]): number | null {
  const now = latest_step(events);
  if (!now) return null;
  const recent = now.iteration - Math.max(now.iterations * 0.1, 1);
  const since = events.findLast((e): e is Step => e.event === 'step' && e.iteration <= recent);
  const [iterations, seconds] = since
    ? [now.iteration - since.iteration, now.seconds - since.seconds]
    : [now.iteration, now.seconds];
  if (iterations <= 0 || seconds <= 0) return null;
  return ((now.iterations - now.iteration) * seconds) / iterations;
}
