import type { TrainingEvent } from '../messages.ts';
import { count } from '../parts/format.ts';

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

export interface Remark {
  text: string;
  wrong: boolean;
}

const endings: Record<Extract<TrainingEvent, { event: 'finished' }>['ending'], string> = {
  completed: 'Completed',
  interrupted: 'Stopped',
  diverged: 'Diverged',
  out_of_memory: 'Ran out of memory',
  no_input: 'Lost its capture',
};
const most_warnings = 3;

// What is to be said of a training beside its figures: how it ended, the last save, the last warnings.
export function remarks(events: readonly TrainingEvent[]): Remark[] {
  const said: Remark[] = [];
  const end = events.findLast((e) => e.event === 'finished');
  if (end) {
    const at = `${endings[end.ending] ?? 'Ended'} at iteration ${count(end.iteration)}`;
    const good = end.ending === 'completed' || end.ending === 'interrupted';
    const reason = end.reason.startsWith('std::') ? '' : end.reason; // a name of the program's, no words
    said.push({ text: reason ? `${at}: ${reason}` : at, wrong: !good });
  }
  const saved = events.findLast((e) => e.event === 'saved');
  if (saved) said.push({ text: `Saved at iteration ${count(saved.iteration)}`, wrong: false });
  const warnings = events.filter((e) => e.event === 'warning').slice(-most_warnings);
  return [...said, ...warnings.map(({ text }) => ({ text: `Warning: ${text}`, wrong: true }))];
}
