import { Button, Choice, Section, Segments, Slider, Switch } from '../parts/controls.tsx';
import { figure, signed, title } from '../parts/format.ts';
import { comparing, exposure, hello, layer, map, rays_on } from '../state/store.ts';
import { pinned, toggle_rays, unpin, unpin_all, type Ray } from '../state/rays.ts';
import {
  chosen_size,
  size_of,
  still_size,
  still_sizes,
  still_wanted,
  take_still,
  type StillSize,
} from '../state/still.ts';
import { moving } from '../stage/view_requests.ts';

export function ViewTab() {
  return (
    <>
      <Layers />
      <Rays />
      <Screenshot />
    </>
  );
}

function Layers() {
  const there = hello.value;
  const layers = there?.layers.filter((l) => l.name !== 'difference') ?? [];
  const kind = layers.find((l) => l.name === layer.value)?.kind ?? 'colour';
  const covered = comparing.value === 'difference' || comparing.value === 'photo';
  return (
    <Section title="Layer" aside={covered && <span class="hint">behind the comparison</span>}>
      <div class="layers" role="radiogroup" aria-label="Layer">
        {layers.map(({ name }, i) => (
          <label key={name} class="layer" data-testid={`layer-${name}`}>
            <input type="radio" name="layer" checked={layer.value === name} onChange={() => (layer.value = name)} />
            <span>{title(name)}</span>
            {name === 'tracks' ? <kbd>M</kbd> : i < 10 && <kbd>{(i + 1) % 10}</kbd>}
          </label>
        ))}
      </div>
      <div class="layer-setting">
        {kind === 'colour' ? (
          <Slider
            id="exposure"
            label="Exposure"
            min={-4}
            max={4}
            step={0.1}
            value={exposure.value}
            shown={`${signed(exposure.value, 1)} stops`}
            onInput={(value) => moving(() => void (exposure.value = value))}
          />
        ) : (
          <Choice
            id="map"
            label="Colour map"
            value={map.value}
            options={(there?.maps ?? []).map((name) => ({ value: name, label: title(name) }))}
            onChange={(name) => (map.value = name)}
          />
        )}
      </div>
    </Section>
  );
}

function Rays() {
  return (
    <Section
      title="Reflection rays"
      aside={<Switch id="rays-panel" label="Show" on={rays_on.value} onChange={toggle_rays} />}
    >
      {pinned.value.length === 0 ? (
        <p class="hint">
          {rays_on.value
            ? 'Point at the picture to see where it mirrors from; click to pin a ray.'
            : 'Where does a reflection come from? Switch on and point.'}
        </p>
      ) : (
        <>
          <ol class="pins" data-testid="pins">
            {pinned.value.map((ray, i) => (
              <Pin key={ray.id} ray={ray} name={`Ray ${i + 1}`} />
            ))}
          </ol>
          <Button id="unpin-all" label="Take all away" keys="X" kind="quiet" onPress={unpin_all} />
        </>
      )}
    </Section>
  );
}

function Pin({ ray, name }: { ray: Ray; name: string }) {
  const reach =
    ray.mirrored && ray.mirrored.distance > 0 ? `meets at ${figure(ray.mirrored.distance)}` : 'meets nothing';
  return (
    <li>
      <b>{name}</b>
      <span>tint {ray.tint === undefined ? '–' : ray.tint.toFixed(2)}</span>
      <span>{reach}</span>
      <Button id="unpin" label={`Take ${name} away`} icon="close" kind="quiet" iconOnly onPress={() => unpin(ray)} />
    </li>
  );
}

function Screenshot() {
  const labels: Record<StillSize, string> = { '1': '1×', '2': '2×', '4': '4×', capture: 'Capture' };
  const options = still_sizes.filter((s) => size_of(s)).map((value) => ({ value, label: labels[value] }));
  const size = size_of(chosen_size.value);
  return (
    <Section title="Screenshot" aside={size && <span class="hint">{`${size.width} × ${size.height}`}</span>}>
      <Segments
        id="still-size"
        label="Size"
        options={options}
        value={chosen_size.value}
        onChange={(v) => (still_size.value = v)}
      />
      <Button
        id="still"
        label={still_wanted.value ? 'Rendering…' : 'Save PNG'}
        keys="G"
        icon="save"
        disabled={still_wanted.value !== 0}
        onPress={take_still}
      />
    </Section>
  );
}
