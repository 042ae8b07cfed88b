import { useEffect, useRef } from 'preact/hooks';
import { Button, Segments } from '../parts/controls.tsx';
import { Compare } from './Compare.tsx';
import type { ReportData } from './data.ts';
import { present, written } from './figures.ts';

export const layers = [
  { key: 'photograph', label: 'Photograph' },
  { key: 'rgb', label: 'Render' },
  { key: 'difference', label: 'Difference' },
  { key: 'diffuse', label: 'Diffuse' },
  { key: 'specular', label: 'Specular' },
  { key: 'normal', label: 'Normal' },
  { key: 'depth', label: 'Depth' },
] as const;

export type LayerKey = (typeof layers)[number]['key'];

export interface Opened {
  index: number; // in the report's pictures
  layer: LayerKey; // beside the photograph
}

interface LargeProps {
  data: ReportData;
  opened: Opened;
  open: (opened: Opened | null) => void;
}

// One view as large as the window, its photograph against a layer; the arrow keys go on to the next view.
export function Large({ data, opened, open }: LargeProps) {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current?.showModal(), []);
  const picture = data.pictures[opened.index];
  if (!picture) return null;
  const view = data.views.find(({ id }) => id === picture.id);
  const step = (by: number): void =>
    open({ ...opened, index: (opened.index + by + data.pictures.length) % data.pictures.length });
  const key = (event: KeyboardEvent): void => {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (by === undefined || (event.target instanceof HTMLInputElement && event.target.type === 'radio')) return;
    event.preventDefault();
    step(by);
  };
  const label = layers.find((l) => l.key === opened.layer)?.label ?? '';
  const aspect = picture.width / picture.height;
  return (
    <dialog
      ref={dialog}
      class="large"
      aria-label={`View ${picture.id}`}
      data-testid="large"
      onClose={() => open(null)}
      onKeyDown={key}
    >
      <div class="large-body" style={{ '--aspect': String(aspect) }} tabIndex={-1} autofocus>
        <div class="large-head">
          <Button id="large-before" label="View before (←)" icon="left" iconOnly onPress={() => step(-1)} />
          <Button id="large-after" label="View after (→)" icon="right" iconOnly onPress={() => step(1)} />
          <h2 data-testid="large-id">{picture.id}</h2>
          <p>
            {view &&
              present(data)
                .filter(({ key: name }) => name === 'psnr' || name === 'ssim' || name === 'lpips')
                .map((kind) => `${kind.label} ${written(view[kind.key], kind)}`)
                .join(' · ')}
          </p>
          <Button id="large-close" label="Close (Esc)" icon="close" kind="quiet" iconOnly onPress={() => open(null)} />
        </div>
        <div class="large-picture">
          <Compare
            key={opened.layer}
            id="large"
            left={picture.photograph}
            right={picture[opened.layer]}
            leftName="Photograph"
            rightName={label}
            aspect={aspect}
          />
        </div>
        <Segments
          id="large-layer"
          label="Beside the photograph"
          options={layers
            .filter((l) => l.key !== 'photograph')
            .map((l) => ({ value: l.key as LayerKey, label: l.label }))}
          value={opened.layer}
          onChange={(layer) => open({ ...opened, layer })}
        />
      </div>
    </dialog>
  );
}
