import { Banner } from './parts/Banner.tsx';
import { HelpDialog } from './parts/HelpDialog.tsx';
import { Panel } from './panel/Panel.tsx';
import { Stage } from './stage/Stage.tsx';
import { panel_open } from './state/panel.ts';

export function App() {
  return (
    <div class={panel_open.value ? 'app' : 'app panel-closed'}>
      <Stage />
      <Panel />
      <Banner />
      <HelpDialog />
    </div>
  );
}
