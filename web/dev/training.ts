import type { TrainingEvent } from '../src/messages.ts';

// A training run that never was: the events of a log, drawn with a fixed seed.

const phases: [string, number][] = [
  ['static', 0],
  ['diffuse', 1200],
  ['specular', 3000],
  ['joint', 4400],
];
export const last_iteration = 8000;

function noise(seed: number): number {
  const x = Math.sin(seed * 12.9898) * 43758.5453;
  return x - Math.floor(x) - 0.5;
}

export class Training {
  iteration = 0;
  paused = false;
  over = false;
  private main = 12000;
  private environment = 9500;
  private seconds = 0;

  surfels = () => ({ main: this.main, environment: this.environment });

  begin(): TrainingEvent[] {
    return [
      {
        event: 'started',
        capture: 'kettle',
        run: 'kettle-spheres',
        iteration: 0,
        iterations: last_iteration,
        device: 'cpu',
        threads: 2,
        seed: 1,
        surfels: this.surfels(),
        forecast_bytes: 1.9e9,
        version: '0.7.0',
        machine: { processor: 'AMD EPYC 7B13', threads: 2, memory_bytes: 24e9, system: 'Debian 12', gpu: '' },
      },
    ];
  }

  // Ten iterations more.
  advance(): TrainingEvent[] {
    if (this.paused || this.over) return [];
    const made: TrainingEvent[] = [];
    for (const [phase, first] of phases) {
      if (this.iteration === first) made.push({ event: 'phase_entered', iteration: first, phase });
    }
    this.iteration += 10;
    const i = this.iteration;
    const phase = phases.findLast(([, first]) => i > first)?.[0] ?? 'static';
    if (i % 80 === 0 && i > 160 && i < 6000) made.push(this.density(i));
    made.push(this.step(i, phase));
    if (i % 1000 === 0) {
      made.push({
        event: 'evaluated',
        iteration: i,
        split: 'test',
        views: 20,
        psnr: 18 + 4.6 * (1 - Math.exp(-i / 2500)),
        ssim: 0.8,
        seconds: 4,
      });
      made.push({ event: 'saved', iteration: i, path: 'checkpoint.safetensors', seconds: 0.4 });
    }
    if (i >= last_iteration) made.push(this.end('completed'));
    return made;
  }

  end(ending: 'completed' | 'interrupted'): TrainingEvent {
    this.over = true;
    return {
      event: 'finished',
      ending,
      iteration: this.iteration,
      seconds: this.seconds,
      psnr: 31.4,
      surfels: this.surfels(),
      reason: '',
    };
  }

  private density(i: number): TrainingEvent {
    const set = i % 160 === 0 ? 'main' : 'environment';
    const grows = set === 'main' ? this.main < 20000 : this.environment < 12000;
    const cloned = grows ? Math.round(300 + 200 * noise(i)) : 20;
    const split = grows ? Math.round(500 + 700 * noise(i + 3)) : 45;
    const reset = i % 1600 === 0;
    const transparent = Math.round((reset ? 900 : 130) + 120 * noise(i + 7));
    const large = i > 2000 ? Math.round(30 + 40 * noise(i + 9)) : 0;
    this[set] += cloned + split - transparent - large;
    return {
      event: 'density_changed',
      iteration: i,
      set,
      cloned,
      split,
      added: 0,
      pruned_transparent: transparent,
      pruned_large: large,
      opacity_reset: reset,
      at_cap: !grows,
      count: this[set],
    };
  }

  private step(i: number, phase: string): TrainingEvent {
    const decay = Math.exp(-i / 1400) + 0.18 + (i % 1600 < 60 && i > 1600 ? 0.12 : 0);
    const rate = 52 - 30 * (this.main / 20000) + 4 * noise(i);
    this.seconds += 10 / rate;
    const l1 = 0.05 * decay * (1 + 0.2 * noise(i));
    const ssim = 0.4 * decay * (1 + 0.1 * noise(i + 1));
    const normal = i > 1200 ? 0.02 * (1 + 0.3 * noise(i + 2)) : 0;
    return {
      event: 'step',
      iteration: i,
      iterations: last_iteration,
      phase,
      loss: 0.8 * l1 + 0.2 * ssim + normal,
      terms: {
        l1,
        ssim,
        normal,
        normal_prior: normal * 0.6,
        distortion: i > 3000 ? 0.003 : 0,
        rigidity: 0.004 * decay,
      },
      psnr: 19 + 12.5 * (1 - Math.exp(-i / 1800)) + 0.7 * noise(i + 5),
      seconds: this.seconds,
      rate,
      surfels: this.surfels(),
      memory_bytes: 6e8 + this.main * 22000,
    };
  }
}
