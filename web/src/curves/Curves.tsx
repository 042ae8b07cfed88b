import { useSignal } from '@preact/signals';
import { useEffect, useMemo } from 'preact/hooks';
import type { TrainingEvent } from '../messages.ts';
import { Segments, Switch } from '../parts/controls.tsx';
import { charts_of } from './charts.ts';
import { Plot } from './Plot.tsx';
import { series_of } from './series.ts';

const least_pause = 400; // ms between two drawings of a run that goes on

// All curves of a training run.
export function Curves({ events, height = 108 }: { events: readonly TrainingEvent[]; height?: number }) {
  const log = useSignal(true);
  const set = useSignal<'main' | 'environment'>('main');
  const drawn = useSlowly(events);
  const series = useMemo(() => series_of(drawn), [drawn]);
  const charts = useMemo(() => charts_of(series, log.value, set.value), [series, log.value, set.value]);
  if (series.steps.iteration.length === 0)
    return <p class="hint curves-none">The curves begin with the first steps.</p>;
  const two_sets = series.density.environment.iteration.length > 0;
  const sets = (
    <Segments
      id="density-set"
      label="Surfels of which set"
      value={set.value}
      options={[
        { value: 'main', label: 'Main' },
        { value: 'environment', label: 'Environment' },
      ]}
      onChange={(value) => (set.value = value)}
    />
  );
  return (
    <div class="curves">
      <div class="curves-head">
        <Switch id="curves-log" label="Loss on a log scale" on={log.value} onChange={(on) => (log.value = on)} />
      </div>
      {charts.map((chart) => (
        <div key={chart.id} class={`curve curve-${chart.id}`}>
          <Plot
            chart={chart}
            aside={chart.id === 'density' && two_sets && sets}
            phases={series.phases}
            height={height}
          />
        </div>
      ))}
    </div>
  );
}

// The newest value, at most every so often.
function useSlowly<T>(value: T): T {
  const shown = useSignal(value);
  const since = useSignal(0);
  useEffect(() => {
    const wait = Math.max(0, since.peek() + least_pause - performance.now());
    const timer = setTimeout(() => {
      since.value = performance.now();
      shown.value = value;
    }, wait);
    return () => clearTimeout(timer);
  }, [value]);
  return shown.value;
}
