import { useSignal } from '@preact/signals';
import { Button, Section } from '../parts/controls.tsx';
import { count, duration } from '../parts/format.ts';
import { Curves } from '../curves/Curves.tsx';
import { latest_step, seconds_left } from '../curves/progress.ts';
import { events, hello, server, training } from '../state/store.ts';
import { send } from '../state/server.ts';

export function TrainingTab() {
  return (
    <>
      {hello.value?.source === 'training' && <Progress />}
      <Curves events={events.value} />
    </>
  );
}

function Progress() {
  const state = server.value;
  const step = latest_step(events.value);
  const share = state && state.iterations > 0 ? state.iteration / state.iterations : 0;
  const left = seconds_left(events.value);
  const says = !state
    ? ''
    : state.over
      ? 'ended'
      : state.paused
        ? 'paused'
        : left === null
          ? ''
          : `about ${duration(left)} left`;
  return (
    <Section
      title={step && !state?.over ? `Phase: ${step.phase}` : 'Training'}
      aside={<span class="hint">{says}</span>}
    >
      <div
        class="progress"
        role="progressbar"
        aria-label="Training"
        aria-valuemin={0}
        aria-valuemax={state?.iterations ?? 0}
        aria-valuenow={state?.iteration ?? 0}
      >
        <i style={{ width: `${share * 100}%` }} />
      </div>
      <p class="figures">
        <b data-testid="iteration">{count(state?.iteration ?? 0)}</b> of {count(state?.iterations ?? 0)} iterations
        {step && <span> · {duration(step.seconds)} so far</span>}
      </p>
      {training.value && <Commands paused={state?.paused ?? false} />}
    </Section>
  );
}

function Commands({ paused }: { paused: boolean }) {
  const asking = useSignal(false);
  if (asking.value) {
    return (
      <div class="row" role="alertdialog" aria-label="Stop the training?">
        <span class="question">Save and end the training?</span>
        <Button
          id="stop-confirm"
          label="Stop"
          kind="danger"
          onPress={() => {
            asking.value = false;
            send({ type: 'command', do: 'stop' });
          }}
        />
        <Button id="stop-cancel" label="Go on" onPress={() => (asking.value = false)} />
      </div>
    );
  }
  return (
    <div class="row">
      <Button
        id={paused ? 'resume' : 'pause'}
        label={paused ? 'Resume' : 'Pause'}
        icon={paused ? 'play' : 'pause'}
        kind={paused ? 'main' : 'plain'}
        onPress={() => send({ type: 'command', do: paused ? 'resume' : 'pause' })}
      />
      <Button id="save" label="Save" icon="save" onPress={() => send({ type: 'command', do: 'save' })} />
      <Button id="stop" label="Stop" icon="stop" onPress={() => (asking.value = true)} />
    </div>
  );
}
