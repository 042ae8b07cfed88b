import type { TrainingEvent } from '../messages.ts';

// The events of a training run that count (state/history.ts), sorted into columns that can be drawn.

export interface Steps {
  iteration: number[];
  loss: number[];
  terms: Map<string, number[]>;
  psnr: number[];
  rate: number[]; // iterations a second
  memory: (number | null)[]; // bytes
  main: number[]; // surfels
  environment: number[];
}

// Growth counts up, pruning counts up too; one entry for each change of density.
export interface Density {
  iteration: number[];
  cloned: number[];
  split: number[];
  added: number[];
  transparent: number[];
  large: number[];
  resets: number[]; // iterations
}

export interface Phase {
  name: string;
  first: number;
  last: number;
}

export interface Series {
  steps: Steps;
  density: { main: Density; environment: Density };
  phases: Phase[];
  held_out: { iteration: number[]; psnr: number[] };
}

const no_density = (): Density => ({ iteration: [], cloned: [], split: [], added: [], transparent: [], large: [], resets: [] });

export function series_of(events: readonly TrainingEvent[]): Series {
  const steps: Steps = {
    iteration: [],
    loss: [],
    terms: new Map(),
    psnr: [],
    rate: [],
    memory: [],
    main: [],
    environment: [],
  };
  const series: Series = {
    steps,
    density: { main: no_density(), environment: no_density() },
    phases: [],
    held_out: { iteration: [], psnr: [] },
  };
  for (const event of events) {
    if (event.event === 'step') add_step(steps, event);
    else if (event.event === 'density_changed') add_density(series.density[event.set], event);
    else if (event.event === 'phase_entered') enter_phase(series.phases, event.phase, event.iteration);
    else if (event.event === 'evaluated' && event.split !== 'train') {
      series.held_out.iteration.push(event.iteration);
      series.held_out.psnr.push(event.psnr);
    }
  }
  const phase = series.phases.at(-1);
  if (phase) phase.last = Math.max(phase.first, steps.iteration.at(-1) ?? 0);
  return series;
}

function add_step(steps: Steps, event: Extract<TrainingEvent, { event: 'step' }>): void {
  const count = steps.iteration.length;
  steps.iteration.push(event.iteration);
  steps.loss.push(event.loss);
  steps.psnr.push(event.psnr);
  steps.rate.push(event.rate);
  steps.memory.push(event.memory_bytes ?? null);
  steps.main.push(event.surfels.main);
  steps.environment.push(event.surfels.environment);
  for (const [name, value] of Object.entries(event.terms)) {
    const column = steps.terms.get(name) ?? new Array<number>(count).fill(0);
    column[count] = value;
    steps.terms.set(name, column);
  }
}

function add_density(density: Density, event: Extract<TrainingEvent, { event: 'density_changed' }>): void {
  density.iteration.push(event.iteration);
  density.cloned.push(event.cloned);
  density.split.push(event.split);
  density.added.push(event.added ?? 0);
  density.transparent.push(event.pruned_transparent);
  density.large.push(event.pruned_large);
  if (event.opacity_reset) density.resets.push(event.iteration);
}

function enter_phase(phases: Phase[], name: string, iteration: number): void {
  const before = phases.at(-1);
  if (before?.name === name) return;
  if (before) before.last = iteration;
  phases.push({ name, first: iteration, last: iteration });
}
