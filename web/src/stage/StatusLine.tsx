import { hello, link, server } from '../state/store.ts';
import { count } from '../parts/format.ts';
import { status_open } from '../state/panel.ts';
import { measures } from './measures.ts';

// How the pictures come and what they are of, in the stage's upper right corner.
export function StatusLine() {
  const m = measures.value;
  const s = server.value;
  const up = link.value.kind === 'open';
  const surfels = s ? count(s.surfels.main) + (s.surfels.environment ? ` + ${count(s.surfels.environment)}` : '') : '';
  return (
    <button
      type="button"
      class="status glass"
      data-testid="status"
      aria-expanded={status_open.value}
      aria-label="Status"
      title="Status (I)"
      onClick={() => (status_open.value = !status_open.value)}
    >
      <span class="status-line">
        <i class={up ? 'lamp on' : 'lamp'} aria-hidden="true" />
        <b>{m ? Math.round(m.rate) : '–'}</b> fps
        <b>{m ? Math.round(m.latency) : '–'}</b> ms
      </span>
      {status_open.value && (
        <dl>
          <Row name="Picture" value={m ? `${m.width} × ${m.height}` : '–'} />
          <Row name="Rendering" value={m ? `${m.milliseconds.toFixed(m.milliseconds < 10 ? 1 : 0)} ms` : '–'} />
          <Row name="Iteration" value={s && s.iterations > 0 ? count(s.iteration) : ''} id="iteration" />
          <Row name="Surfels" value={surfels} />
          <Row name="Viewers" value={s ? count(s.viewers) : ''} />
          <Row name="Device" value={hello.value?.device ?? ''} />
        </dl>
      )}
    </button>
  );
}

function Row({ name, value, id }: { name: string; value: string; id?: string }) {
  if (!value) return null;
  return (
    <div>
      <dt>{name}</dt>
      <dd data-testid={id && `status-${id}`}>{value}</dd>
    </div>
  );
}
