import { Button } from '../parts/controls.tsx';
import { Icon, type IconName } from '../parts/Icon.tsx';
import { ThemeButton } from '../parts/ThemeButton.tsx';
import { choose_tab, help_open, panel_open, tab, tabs, type Tab } from '../state/panel.ts';
import { events, hello } from '../state/store.ts';
import { CamerasTab } from './CamerasTab.tsx';
import { PathTab } from './PathTab.tsx';
import { TrainingTab } from './TrainingTab.tsx';
import { ViewTab } from './ViewTab.tsx';

const faces: Record<Tab, { label: string; icon: IconName; body: () => preact.JSX.Element }> = {
  view: { label: 'View', icon: 'layers', body: ViewTab },
  cameras: { label: 'Cameras', icon: 'frames', body: CamerasTab },
  path: { label: 'Path', icon: 'path', body: PathTab },
  training: { label: 'Training', icon: 'chart', body: TrainingTab },
};

function is_there(name: Tab): boolean {
  const there = hello.value;
  if (name === 'cameras') return !!there && there.cameras.train.length + there.cameras.test.length > 0;
  if (name === 'training') return !!there && (there.source === 'training' || events.value.length > 0);
  return true;
}

export function Panel() {
  const present = tabs.filter(is_there);
  const current = present.includes(tab.value) ? tab.value : 'view';
  const Body = faces[current].body;
  return (
    <aside class="panel" aria-label="Panel" data-tab={current}>
      <Head />
      <div class="tabs" role="tablist" aria-label="Panel" onKeyDown={(event) => walk(event, present, current)}>
        {present.map((name) => (
          <button
            key={name}
            type="button"
            role="tab"
            id={`tab-${name}`}
            data-tab={name}
            data-testid={`tab-${name}`}
            aria-selected={name === current}
            aria-controls="tab-body"
            tabIndex={name === current ? 0 : -1}
            onClick={() => choose_tab(name)}
          >
            <Icon name={faces[name].icon} />
            <span>{faces[name].label}</span>
          </button>
        ))}
      </div>
      <div class="tab-body" id="tab-body" role="tabpanel" aria-labelledby={`tab-${current}`} hidden={!panel_open.value}>
        <Body />
      </div>
    </aside>
  );
}

function walk(event: KeyboardEvent, present: Tab[], current: Tab): void {
  const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (by === undefined) return;
  const next = present[(present.indexOf(current) + by + present.length) % present.length] ?? current;
  tab.value = next;
  document.getElementById(`tab-${next}`)?.focus();
}

function Head() {
  const there = hello.value;
  const kinds = { training: 'Training', run: 'Run', ply: 'Surfels' };
  const about = there ? [kinds[there.source], there.capture].filter(Boolean).join(' · ') : 'Connecting…';
  return (
    <header class="panel-head">
      <img src="/icon.svg" alt="" width={28} height={28} />
      <div class="panel-title">
        <h1 title={there?.name}>{there?.name ?? 'TraceFlow'}</h1>
        <p>{about}</p>
      </div>
      <ThemeButton />
      <Button
        id="help-open"
        label="Keys"
        keys="?"
        icon="help"
        kind="quiet"
        iconOnly
        onPress={() => (help_open.value = true)}
      />
    </header>
  );
}
