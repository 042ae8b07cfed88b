import { useEffect, useRef } from 'preact/hooks';
import { key_list } from '../stage/keys.ts';
import { help_open } from '../state/panel.ts';
import { Button } from './controls.tsx';

export function HelpDialog() {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    if (help_open.value && !dialog.current?.open) dialog.current?.showModal();
    if (!help_open.value) dialog.current?.close();
  }, [help_open.value]);
  return (
    <dialog
      ref={dialog}
      class="help"
      aria-label="Keys"
      data-testid="help"
      onClose={() => (help_open.value = false)}
      onClick={(event) => event.target === event.currentTarget && (help_open.value = false)}
    >
      <div class="help-body">
        <div class="help-head">
          <h1>Keys</h1>
          <Button
            id="help-close"
            label="Close"
            icon="close"
            kind="quiet"
            iconOnly
            onPress={() => (help_open.value = false)}
          />
        </div>
        <div class="help-columns">
          {key_list.map((group) => (
            <section key={group.title}>
              <h2>{group.title}</h2>
              <dl>
                {group.keys.map((key) => (
                  <div key={key.shown}>
                    <dt>{key.shown}</dt>
                    <dd>{key.does}</dd>
                  </div>
                ))}
              </dl>
            </section>
          ))}
        </div>
      </div>
    </dialog>
  );
}
