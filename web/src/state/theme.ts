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
    const dark = theme.value === 'dark' || (theme.value === 'auto' && system.matches);
    document.documentElement.dataset['theme'] = dark ? 'dark' : 'light';
    try {
      localStorage.setItem(key, theme.value);
    } catch {
      // A page opened from disk, or in a private window, may not remember.
    }
    repaint.value = repaint.peek() + 1;
  });
  system.addEventListener('change', () => {
    document.documentElement.dataset['theme'] = theme.value === 'auto' ? (system.matches ? 'dark' : 'light') : theme.value;
    repaint.value++;
  });
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
