import { count, duration } from '../parts/format.ts';
import type { ReportData } from './data.ts';

// How long each phase took, and the steps within it, as bars on one scale of the phase.
export function Times({ phases }: { phases: ReportData['phases'] }) {
  const total = phases.reduce((sum, phase) => sum + phase.seconds, 0);
  return (
    <div class="times">
      {phases.map((phase) => {
        const steps = [...phase.steps].sort((a, b) => b.seconds - a.seconds);
        const longest = steps[0]?.seconds ?? 0;
        return (
          <article key={`${phase.name} ${phase.first}`} class="time">
            <h3>
              {phase.name}
              <small>
                {count(phase.first)}–{count(phase.last)}
              </small>
              <b>{duration(phase.seconds)}</b>
            </h3>
            <div class="bar whole" title={`${share(phase.seconds, total)} of all`}>
              <i style={{ width: share(phase.seconds, total) }} />
            </div>
            {steps.map((step) => (
              <div key={step.name} class="time-step">
                <span>{step.name}</span>
                <div class="bar">
                  <i style={{ width: share(step.seconds, longest) }} />
                </div>
                <b>{duration(step.seconds)}</b>
                <small>{share(step.seconds, phase.seconds)}</small>
              </div>
            ))}
          </article>
        );
      })}
    </div>
  );
}

const share = (part: number, whole: number): string => `${whole > 0 ? Math.round((1000 * part) / whole) / 10 : 0}%`;
