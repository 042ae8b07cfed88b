import { useState } from 'preact/hooks';
import type { Figures, ReportData } from './data.ts';
import { ends, present, sorted, written, type Kind, type Order, type View } from './figures.ts';
import type { Opened } from './Large.tsx';

// All figures of all views; a press on a column's head sorts by it.
export function FigureTable({ data, open }: { data: ReportData; open: (opened: Opened) => void }) {
  const [order, set_order] = useState<Order>({ by: 'id', falling: false });
  const kinds = present(data);
  const marks = new Map(kinds.map((kind) => [kind.key, ends(data.views, kind)]));
  const sort = (by: Order['by'], best_first: boolean): void =>
    set_order((before) => (before.by === by ? { by, falling: !before.falling } : { by, falling: best_first }));
  const head = (by: Order['by'], label: string, unit = '', falling = false) => (
    <th key={by} scope="col" aria-sort={order.by !== by ? 'none' : order.falling ? 'descending' : 'ascending'}>
      <button type="button" data-testid={`sort-${by}`} onClick={() => sort(by, falling)}>
        {label}
        {unit && <small> {unit}</small>}
      </button>
    </th>
  );
  return (
    <>
      <div class="table-box" tabIndex={0} role="region" aria-label="Figures of each view">
        <table class="figures" data-testid="figures">
          <thead>
            <tr>
              {head('id', 'View')}
              {head('time', 'Time')}
              {kinds.map((kind) => head(kind.key, kind.label, kind.unit, kind.higher_is_better))}
            </tr>
          </thead>
          <tbody>
            {sorted(data.views, order).map((view) => (
              <Row
                key={view.id}
                view={view}
                kinds={kinds}
                marks={marks}
                picture={data.pictures.findIndex((p) => p.id === view.id)}
                open={open}
              />
            ))}
          </tbody>
          <tfoot>
            <Mean label="Mean" figures={data.mean} kinds={kinds} />
            {data.mean_aligned && <Mean label="Mean, aligned cameras" figures={data.mean_aligned} kinds={kinds} />}
          </tfoot>
        </table>
      </div>
      <p class="legend">
        <i class="best">▲</i> best <i class="worst">▼</i> worst
      </p>
    </>
  );
}

function Mean({ label, figures, kinds }: { label: string; figures: Figures; kinds: Kind[] }) {
  return (
    <tr>
      <th scope="row" colSpan={2}>
        {label}
      </th>
      {kinds.map((kind) => (
        <td key={kind.key}>{written(figures[kind.key], kind)}</td>
      ))}
    </tr>
  );
}

interface RowProps {
  view: View;
  kinds: Kind[];
  marks: Map<Kind['key'], ReturnType<typeof ends>>;
  picture: number; // index, −1 where the report has none of this view
  open: (opened: Opened) => void;
}

function Row({ view, kinds, marks, picture, open }: RowProps) {
  return (
    <tr>
      <th scope="row">
        {picture < 0 ? (
          view.id
        ) : (
          <button type="button" class="link" onClick={() => open({ index: picture, layer: 'rgb' })}>
            {view.id}
          </button>
        )}
      </th>
      <td>{view.time.toFixed(3)}</td>
      {kinds.map((kind) => {
        const value = view[kind.key];
        const mark = marks.get(kind.key);
        const is = value === null || !mark ? '' : value === mark.best ? 'best' : value === mark.worst ? 'worst' : '';
        return (
          <td key={kind.key} class={is}>
            {is && <i aria-label={is}>{is === 'best' ? '▲' : '▼'}</i>}
            {written(value, kind)}
          </td>
        );
      })}
    </tr>
  );
}
