import { effect, signal } from '@preact/signals';

export type Theme = 'auto' | 'light' | 'dark';

const key = 'traceflow theme';
const is_theme = (text: string | null): text is Theme => text === 'auto' || text === 'light' || text === 'dark';

const stored = read();
export const theme = signal<Theme>(stored);
// Counts changes of the colours on the screen, for what is drawn rather than styled.
export const repaint = signal(0);

const system = window.matchMedia('(prefers-color-scheme: dark)');

export function start_theme(): void {
  effect(() => {
    wear(theme.value);
    try {
      localStorage.setItem(key, theme.value);
    } catch {
      // A page opened from disk, or in a private window, may not remember.
    }
  });
  system.addEventListener('change', () => wear(theme.value));
  // Paper is white.
  window.addEventListener('beforeprint', () => wear('light'));
  window.addEventListener('afterprint', () => wear(theme.value));
}

function wear(wanted: Theme): void {
  const dark = wanted === 'dark' || (wanted === 'auto' && system.matches);
  document.documentElement.dataset['theme'] = dark ? 'dark' : 'light';
  repaint.value = repaint.peek() + 1;
}

export const next_theme = (): void =>
  void (theme.value = theme.value === 'auto' ? 'light' : theme.value === 'light' ? 'dark' : 'auto');

function read(): Theme {
  try {
    const text = localStorage.getItem(key);
    return is_theme(text) ? text : 'auto';
  } catch {
    return 'auto';
  }
}
