import { Button, Choice, Slider } from '../parts/controls.tsx';
import { hello, looping, playing, speed, time } from '../state/store.ts';
import { set_time, toggle_playing } from '../state/clock.ts';

const speeds = [0.25, 0.5, 1, 2, 4];

export function Timeline() {
  if (!hello.value?.moves) return null;
  return (
    <div class="timeline glass" role="group" aria-label="Time">
      <Button
        id="play"
        label={playing.value ? 'Pause' : 'Play'}
        keys="Space"
        icon={playing.value ? 'pause' : 'play'}
        iconOnly
        onPress={toggle_playing}
      />
      <Slider
        id="time"
        label="Time"
        bare
        min={0}
        max={1}
        step={0.001}
        value={time.value}
        shown={time.value.toFixed(3)}
        onInput={(value) => {
          playing.value = false;
          set_time(value);
        }}
      />
      <output class="timeline-value" data-testid="time-value">
        {time.value.toFixed(3)}
      </output>
      <Choice
        id="speed"
        label="Speed"
        value={String(speed.value)}
        options={speeds.map((s) => ({ value: String(s), label: `${s}×` }))}
        onChange={(value) => (speed.value = Number(value))}
      />
      <Button
        id="loop"
        label="Loop"
        icon="loop"
        iconOnly
        pressed={looping.value}
        onPress={() => (looping.value = !looping.value)}
      />
    </div>
  );
}
