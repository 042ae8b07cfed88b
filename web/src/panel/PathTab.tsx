import { useRef } from 'preact/hooks';
import type { Keyframe } from '../messages.ts';
import { empty_path, moved_keyframe, total_seconds, with_seconds, without_keyframe } from '../math/keyframes.ts';
import { Button, Choice, Section, Switch } from '../parts/controls.tsx';
import { duration } from '../parts/format.ts';
import { add_keyframe, export_path, import_path, path, path_visible, shots, toggle_preview } from '../state/path.ts';
import { hello, previewing } from '../state/store.ts';
import { fly_to } from '../stage/travel.ts';

const sizes = ['1280x720', '1920x1080', '3840x2160', '1080x1080', '1080x1920'];
const rates = ['24', '25', '30', '50', '60'];

export function PathTab() {
  const { keyframes } = path.value;
  return (
    <>
      <Section
        title="Camera path"
        aside={<span class="hint">{keyframes.length > 1 ? duration(total_seconds(path.value)) : ''}</span>}
      >
        <div class="row">
          <Button id="keyframe-add" label="Add keyframe" keys="K" icon="plus" kind="main" onPress={add_keyframe} />
          <Button
            id="path-preview"
            label={previewing.value ? 'Stop' : 'Preview'}
            keys="P"
            icon={previewing.value ? 'stop' : 'play'}
            disabled={shots.value.length === 0}
            onPress={toggle_preview}
          />
        </div>
        {keyframes.length === 0 ? (
          <p class="hint">
            Look from where the film should begin and add a keyframe; then go on to the next place and time.
          </p>
        ) : (
          <ol class="keyframes" data-testid="keyframes">
            {keyframes.map((keyframe, i) => (
              <KeyframeRow key={i} keyframe={keyframe} index={i} last={i === keyframes.length - 1} />
            ))}
          </ol>
        )}
        <Switch
          id="path-visible"
          label="Show in the scene"
          on={path_visible.value}
          onChange={(on) => (path_visible.value = on)}
        />
      </Section>
      <Film />
    </>
  );
}

function KeyframeRow({ keyframe, index, last }: { keyframe: Keyframe; index: number; last: boolean }) {
  const { closed } = path.value;
  const move = (by: number) => (path.value = moved_keyframe(path.value, index, index + by));
  return (
    <li>
      <button
        type="button"
        class="keyframe-go"
        title="Go there"
        data-testid={`keyframe-${index}`}
        onClick={() => fly_to(keyframe, keyframe.time)}
      >
        <b>{index + 1}</b>
        {hello.value?.moves && <small>t {keyframe.time.toFixed(2)}</small>}
      </button>
      {!last || closed ? (
        <label class="seconds">
          <input
            type="number"
            min={0.1}
            max={600}
            step={0.1}
            value={keyframe.seconds}
            aria-label={`Seconds from keyframe ${index + 1} to the next`}
            data-testid={`keyframe-seconds-${index}`}
            onChange={(event) => {
              const value = event.currentTarget.valueAsNumber;
              if (value > 0) path.value = with_seconds(path.value, index, value);
              else event.currentTarget.value = String(keyframe.seconds);
            }}
          />
          <span>s</span>
        </label>
      ) : (
        <span class="seconds">end</span>
      )}
      <Button
        id={`keyframe-up-${index}`}
        label="Earlier"
        icon="up"
        kind="quiet"
        iconOnly
        disabled={index === 0}
        onPress={() => move(-1)}
      />
      <Button
        id={`keyframe-down-${index}`}
        label="Later"
        icon="down"
        kind="quiet"
        iconOnly
        disabled={last}
        onPress={() => move(1)}
      />
      <Button
        id={`keyframe-delete-${index}`}
        label={`Delete keyframe ${index + 1}`}
        icon="bin"
        kind="quiet"
        iconOnly
        onPress={() => (path.value = without_keyframe(path.value, index))}
      />
    </li>
  );
}

function Film() {
  const file = useRef<HTMLInputElement>(null);
  const { width, height, fps, closed, keyframes } = path.value;
  const size = `${width}x${height}`;
  const set_size = (text: string): void => {
    const [w = width, h = height] = text.split('x').map(Number);
    path.value = { ...path.value, width: w, height: h };
  };
  const frames = shots.value.length;
  return (
    <Section title="Film" aside={<span class="hint">{frames > 0 ? `${frames} frames` : ''}</span>}>
      <div class="choices">
        <Choice
          id="path-size"
          label="Size"
          value={size}
          options={[...new Set([...sizes, size])].map((s) => ({ value: s, label: s.replace('x', ' × ') }))}
          onChange={set_size}
        />
        <Choice
          id="path-fps"
          label="Frames per second"
          value={String(fps)}
          options={[...new Set([...rates, String(fps)])].map((r) => ({ value: r, label: r }))}
          onChange={(value) => (path.value = { ...path.value, fps: Number(value) })}
        />
      </div>
      <Switch
        id="path-closed"
        label="Go back to the first keyframe"
        on={closed}
        onChange={(on) => (path.value = { ...path.value, closed: on })}
      />
      <div class="row">
        <Button id="path-export" label="Export" icon="save" disabled={keyframes.length === 0} onPress={export_path} />
        <Button id="path-import" label="Import" icon="load" onPress={() => file.current?.click()} />
        <Button
          id="path-clear"
          label="Clear"
          icon="bin"
          disabled={keyframes.length === 0}
          onPress={() => (path.value = { ...path.value, keyframes: empty_path.keyframes })}
        />
      </div>
      <input
        ref={file}
        type="file"
        accept="application/json,.json"
        class="hidden-file"
        aria-label="Camera path to import"
        tabIndex={-1}
        data-testid="path-file"
        onChange={(event) => {
          const chosen = event.currentTarget.files?.[0];
          if (chosen) void import_path(chosen);
          event.currentTarget.value = '';
        }}
      />
      <p class="hint">Rendered with traceflow render RUN --camera-path FILE.</p>
    </Section>
  );
}
