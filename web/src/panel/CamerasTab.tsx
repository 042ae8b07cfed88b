import { useEffect, useRef } from 'preact/hooks';
import { Button, Section, Segments, Slider } from '../parts/controls.tsx';
import { captured_view, comparable, comparison, hello, photo } from '../state/store.ts';
import { go_to, listed, split, step_camera } from '../state/cameras.ts';

export function CamerasTab() {
  return (
    <>
      <Compare />
      <CameraList />
    </>
  );
}

function Compare() {
  const view = captured_view.value;
  const hint = !view ? 'go to a camera' : comparable.value ? view.id : 'the time is not that of the photograph';
  return (
    <Section title="Compare with the photograph" aside={<span class="hint">{hint}</span>}>
      <Segments
        id="compare"
        label="Comparison"
        value={comparison.value}
        onChange={(value) => (comparison.value = value)}
        options={[
          { value: 'render', label: 'Render' },
          { value: 'split', label: 'Split' },
          { value: 'photo', label: 'Photo' },
          {
            value: 'difference',
            label: 'Difference',
            disabled: !hello.value?.layers.some((l) => l.name === 'difference'),
          },
        ]}
      />
    </Section>
  );
}

function CameraList() {
  const views = listed.value;
  const current = photo.value?.split === split.value ? photo.value.index : -1;
  const cameras = hello.value?.cameras;
  const list = useRef<HTMLOListElement>(null);
  useEffect(() => {
    const row = list.current?.querySelector<HTMLElement>('[aria-current=true]');
    if (!list.current || !row) return;
    // Within the list alone: the panel stays where it is.
    const top = row.offsetTop - list.current.offsetTop;
    const { scrollTop, clientHeight } = list.current;
    if (top < scrollTop) list.current.scrollTop = top;
    else if (top + row.offsetHeight > scrollTop + clientHeight)
      list.current.scrollTop = top + row.offsetHeight - clientHeight;
  }, [current, split.value]);
  return (
    <Section title="Captured cameras">
      <Segments
        id="split-set"
        label="Split"
        value={split.value}
        onChange={(value) => (split.value = value)}
        options={[
          { value: 'test', label: `Test ${cameras?.test.length ?? 0}`, disabled: !cameras?.test.length },
          { value: 'train', label: `Train ${cameras?.train.length ?? 0}`, disabled: !cameras?.train.length },
        ]}
      />
      <div class="camera-steps">
        <Button
          id="camera-before"
          label="Camera before"
          keys="["
          icon="left"
          iconOnly
          onPress={() => step_camera(-1)}
        />
        <Slider
          id="camera-scrub"
          label="Captured camera"
          bare
          min={0}
          max={Math.max(views.length - 1, 0)}
          step={1}
          value={Math.max(current, 0)}
          shown={views[Math.max(current, 0)]?.id ?? ''}
          onInput={go_to}
        />
        <Button id="camera-after" label="Camera after" keys="]" icon="right" iconOnly onPress={() => step_camera(1)} />
      </div>
      <ol class="cameras" ref={list} data-testid="cameras">
        {views.map((view, i) => (
          <li key={view.id}>
            <button type="button" aria-current={i === current} data-testid={`camera-${i}`} onClick={() => go_to(i)}>
              <span>{view.id}</span>
              <small>{view.time.toFixed(3)}</small>
            </button>
          </li>
        ))}
      </ol>
    </Section>
  );
}
