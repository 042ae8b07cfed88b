import { useState } from 'preact/hooks';
import { Switch } from '../parts/controls.tsx';
import type { ReportData } from './data.ts';

type Setting = ReportData['settings'][number];

const is_changed = (setting: Setting): boolean => setting.value !== setting.default;

// Every setting of the run, those first that differ from their defaults.
export function Settings({ settings }: { settings: Setting[] }) {
  const [wanted, set_wanted] = useState('');
  const [only_changed, set_only_changed] = useState(false);
  const words = wanted.toLowerCase().split(/\s+/).filter(Boolean);
  const found = settings.filter((setting) => {
    const text = `${setting.path} ${setting.help} ${setting.value}`.toLowerCase();
    return words.every((word) => text.includes(word)) && (!only_changed || is_changed(setting));
  });
  const ordered = [...found.filter(is_changed), ...found.filter((setting) => !is_changed(setting))];
  return (
    <>
      <div class="settings-head">
        <input
          type="search"
          placeholder="Filter"
          aria-label="Filter the settings"
          data-testid="settings-filter"
          value={wanted}
          onInput={(event) => set_wanted(event.currentTarget.value)}
        />
        <Switch id="settings-changed" label="Changed only" on={only_changed} onChange={set_only_changed} />
        <span class="hint">
          {found.length} of {settings.length}
        </span>
      </div>
      <div class="table-box" tabIndex={0} role="region" aria-label="Settings">
        <table class="settings" data-testid="settings">
          <thead>
            <tr>
              <th scope="col">Setting</th>
              <th scope="col">Value</th>
              <th scope="col">Default</th>
              <th scope="col">Meaning</th>
            </tr>
          </thead>
          <tbody>
            {ordered.map((setting) => (
              <tr key={setting.path} class={is_changed(setting) ? 'changed' : ''}>
                <th scope="row">{setting.path}</th>
                <td>
                  {setting.value} {setting.unit}
                </td>
                <td>{is_changed(setting) ? setting.default : ''}</td>
                <td>{setting.help}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </>
  );
}
