import type { ComponentChildren } from 'preact';
import { useId } from 'preact/hooks';
import { Icon, type IconName } from './Icon.tsx';

// The page's controls. Each has a name for tests (`data-testid`) and a name for people.

interface ButtonProps {
  id: string; // for tests
  label: string;
  icon?: IconName;
  onPress: () => void;
  pressed?: boolean; // of a button that stays pressed
  disabled?: boolean;
  kind?: 'plain' | 'main' | 'danger' | 'quiet';
  keys?: string; // that do the same
  iconOnly?: boolean;
}

export function Button({ id, label, icon, onPress, pressed, disabled, kind = 'plain', keys, iconOnly }: ButtonProps) {
  return (
    <button
      type="button"
      class={`button ${kind}${iconOnly ? ' icon-only' : ''}`}
      data-testid={id}
      aria-label={iconOnly ? label : undefined}
      aria-pressed={pressed}
      aria-keyshortcuts={keys}
      title={keys ? `${label} (${keys})` : iconOnly ? label : undefined}
      disabled={disabled}
      onClick={onPress}
    >
      {icon && <Icon name={icon} />}
      {!iconOnly && <span>{label}</span>}
    </button>
  );
}

interface SegmentsProps<T extends string> {
  id: string;
  label: string;
  options: readonly { value: T; label: string; icon?: IconName; disabled?: boolean }[];
  value: T;
  onChange: (value: T) => void;
}

export function Segments<T extends string>({ id, label, options, value, onChange }: SegmentsProps<T>) {
  const name = useId();
  return (
    <div class="segments" role="radiogroup" aria-label={label} data-testid={id}>
      {options.map((option) => (
        <label
          key={option.value}
          class="segment"
          data-testid={`${id}-${option.value}`}
          title={option.icon ? option.label : undefined}
        >
          <input
            type="radio"
            name={name}
            aria-label={option.label}
            checked={option.value === value}
            disabled={option.disabled}
            onChange={() => onChange(option.value)}
          />
          {option.icon ? <Icon name={option.icon} /> : <span>{option.label}</span>}
        </label>
      ))}
    </div>
  );
}

interface SliderProps {
  id: string;
  label: string;
  value: number;
  min: number;
  max: number;
  step: number;
  shown: string; // the value in words
  onInput: (value: number) => void;
  bare?: boolean; // without the line of label and value
}

export function Slider({ id, label, value, min, max, step, shown, onInput, bare }: SliderProps) {
  const input = (
    <input
      type="range"
      class="range"
      data-testid={id}
      aria-label={label}
      aria-valuetext={shown}
      min={min}
      max={max}
      step={step}
      value={value}
      ref={(element) => element?.style.setProperty('--share', String(max > min ? (value - min) / (max - min) : 0))}
      onInput={(event) => onInput(event.currentTarget.valueAsNumber)}
    />
  );
  if (bare) return input;
  return (
    <div class="field">
      <div class="field-line">
        <span>{label}</span>
        <output>{shown}</output>
      </div>
      {input}
    </div>
  );
}

interface SwitchProps {
  id: string;
  label: string;
  on: boolean;
  onChange: (on: boolean) => void;
}

export function Switch({ id, label, on, onChange }: SwitchProps) {
  return (
    <label class="switch">
      <input
        type="checkbox"
        role="switch"
        data-testid={id}
        checked={on}
        onChange={(event) => onChange(event.currentTarget.checked)}
      />
      <span>{label}</span>
    </label>
  );
}

interface ChoiceProps {
  id: string;
  label: string;
  options: readonly { value: string; label: string }[];
  value: string;
  onChange: (value: string) => void;
}

export function Choice({ id, label, options, value, onChange }: ChoiceProps) {
  return (
    <label class="choice">
      <span>{label}</span>
      <select data-testid={id} value={value} onChange={(event) => onChange(event.currentTarget.value)}>
        {options.map((option) => (
          <option key={option.value} value={option.value}>
            {option.label}
          </option>
        ))}
      </select>
    </label>
  );
}

export function Section({
  title,
  aside,
  children,
}: {
  title: string;
  aside?: ComponentChildren;
  children: ComponentChildren;
}) {
  return (
    <section class="section">
      <div class="section-head">
        <h2>{title}</h2>
        {aside}
      </div>
      {children}
    </section>
  );
}
