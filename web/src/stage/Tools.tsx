import { Button, Segments } from '../parts/controls.tsx';
import { mode, rays_on } from '../state/store.ts';
import { toggle_rays } from '../state/rays.ts';
import { still_wanted, take_still } from '../state/still.ts';
import { panel_open, toggle_panel } from '../state/panel.ts';
import { reset_view } from './travel.ts';

// The tools that lie over the picture's upper left corner.
export function Tools() {
  return (
    <div class="tools glass" role="toolbar" aria-label="Tools">
      <Segments
        id="mode"
        label="What a drag does"
        value={mode.value}
        onChange={(value) => (mode.value = value)}
        options={[
          { value: 'orbit', label: 'Orbit (F)', icon: 'orbit' },
          { value: 'fly', label: 'Fly (F; W A S D Q E)', icon: 'fly' },
        ]}
      />
      <Button
        id="rays"
        label="Reflection rays"
        keys="T"
        icon="ray"
        iconOnly
        pressed={rays_on.value}
        onPress={toggle_rays}
      />
      <Button id="reset" label="Back to the start" keys="R" icon="reset" iconOnly onPress={reset_view} />
      <Button
        id="still-quick"
        label="Screenshot"
        keys="G"
        icon="camera"
        iconOnly
        disabled={still_wanted.value !== 0}
        onPress={take_still}
      />
      <span class="wide-only">
        <Button
          id="panel-toggle"
          label="Panel"
          keys="\"
          icon="panel"
          iconOnly
          pressed={panel_open.value}
          onPress={toggle_panel}
        />
      </span>
    </div>
  );
}
