import { next_theme, theme } from '../state/theme.ts';
import { Button } from './controls.tsx';

const faces = {
  auto: { label: 'Colours as the system has them', icon: 'auto' },
  light: { label: 'Light colours', icon: 'sun' },
  dark: { label: 'Dark colours', icon: 'moon' },
} as const;

export function ThemeButton() {
  const { label, icon } = faces[theme.value];
  return <Button id="theme" label={label} keys="L" icon={icon} kind="quiet" iconOnly onPress={next_theme} />;
}
