import type { ReportData } from './data.ts';
import { present, written } from './figures.ts';
import { layers, type Opened } from './Large.tsx';

// A row of pictures for each view.
export function Views({ data, open }: { data: ReportData; open: (opened: Opened) => void }) {
  const psnr = present(data).find(({ key }) => key === 'psnr');
  return (
    <ol class="views" data-testid="views">
      {data.pictures.map((picture, index) => {
        const view = data.views.find(({ id }) => id === picture.id);
        return (
          <li key={picture.id} class="view">
            <h3>
              {picture.id}
              {psnr && view && <small>{written(view.psnr, psnr)} dB</small>}
            </h3>
            <div class="strip">
              {layers.map(({ key, label }) => (
                <button
                  key={key}
                  type="button"
                  aria-label={`${picture.id}, ${label}, large`}
                  onClick={() => open({ index, layer: key })}
                >
                  <img src={picture[key]} alt="" width={picture.width} height={picture.height} decoding="async" />
                  <span>{label}</span>
                </button>
              ))}
            </div>
          </li>
        );
      })}
    </ol>
  );
}
