import { effect, signal } from '@preact/signals';

export const tabs = ['view', 'cameras', 'path', 'training'] as const;
export type Tab = (typeof tabs)[number];

export const narrow = window.matchMedia('(max-width: 760px)');
export const panel_open = signal(!narrow.matches);
export const tab = signal<Tab>('view');
export const help_open = signal(false);
export const status_open = signal(!narrow.matches);

// On a narrow screen a tab opens the sheet, and the open one closes it.
export function choose_tab(next: Tab): void {
  if (!narrow.matches) tab.value = next;
  else if (panel_open.value && tab.value === next) panel_open.value = false;
  else {
    tab.value = next;
    panel_open.value = true;
  }
}

export const toggle_panel = (): void => void (panel_open.value = !panel_open.value);

effect(() => {
  document.documentElement.dataset['panel'] = panel_open.value ? 'open' : 'closed';
});
