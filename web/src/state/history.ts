import type { TrainingEvent } from '../messages.ts';

const most_steps = 4000;

// The events of a training that count, in order. Of the steps every n-th is kept, n doubling as the run gets long, by
// the rule of src/serve/clients/history.cpp; a resumed run goes back to its checkpoint, by that of
// src/record/log_history.cpp.
export class History {
  private kept: TrainingEvent[] = [];
  private steps = 0; // of those kept
  private stride = 1;
  private last_step = 0;
  private readonly warnings = new Set<string>();

  add(event: TrainingEvent): void {
    if (event.event === 'started') this.go_back_to(event.iteration);
    if (event.event === 'step') {
      // Steps that begin anew although no start was told.
      if (event.iteration <= this.last_step) this.go_back_to(event.iteration - 1);
      this.last_step = event.iteration;
      if (event.iteration % this.stride !== 0) return;
      this.steps++;
    }
    if (event.event === 'warning') {
      if (this.warnings.has(event.text)) return;
      this.warnings.add(event.text);
    }
    this.kept.push(event);
    if (this.steps > most_steps) this.thin();
  }

  list(): TrainingEvent[] {
    return [...this.kept];
  }

  private thin(): void {
    this.stride *= 2;
    this.keep((e) => e.event !== 'step' || e.iteration % this.stride === 0);
  }

  // To when `done` iterations were done. A phase that begins there is told again.
  private go_back_to(done: number): void {
    this.last_step = done;
    if (done <= 0) this.stride = 1;
    this.keep(
      (e) =>
        done > 0 &&
        e.iteration <= done &&
        e.event !== 'finished' &&
        !(e.event === 'phase_entered' && e.iteration === done),
    );
  }

  private keep(counts: (event: TrainingEvent) => boolean): void {
    this.kept = this.kept.filter(counts);
    this.steps = this.kept.filter((e) => e.event === 'step').length;
    this.warnings.clear();
    for (const e of this.kept) if (e.event === 'warning') this.warnings.add(e.text);
  }
}
