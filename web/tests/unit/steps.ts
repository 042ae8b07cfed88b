import type { TrainingEvent } from '../../src/messages.ts';

export const step = (iteration: number, loss = 1, terms: Record<string, number> = {}): TrainingEvent => ({
  event: 'step',
  iteration,
  iterations: 1000,
  phase: 'diffuse',
  loss,
  terms,
  psnr: 20,
  seconds: iteration / 10,
  rate: 10,
  surfels: { main: 5, environment: 3 },
});
