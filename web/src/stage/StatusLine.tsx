import { hello, link, server } from '../state/store.ts';
import { count } from '../parts/format.ts';
import { status_open } from '../state/panel.ts';
import { measures } from './measures.ts';

// How the pictures come and what they are of, in the stage's upper right corner.
export function StatusLine() {
  const m = measures.value;
  const s = server.value;
  return (
    <button
      type="button"
      class="status glass"
      data-testid="status"
      aria-expanded={status_open.value}
      title="Status (I)"
      onClick={() => (status_open.value = !status_open.value)}
    >
      <span class="status-line">
        <i class={link.value.kind === 'open' ? 'lamp on' : 'lamp'} aria-hidden="true" />
        <span title="Pictures in the last second">
          <b>{m ? m.rate : '–'}</b> fps
        </span>
        <span title="From input to the picture that shows it">
          <b>{m ? Math.round(m.latency) : '–'}</b> ms
        </span>
        {status_open.value && (
          <span title="Size of the picture, and the time to render and pack it">
            <b>{m ? `${m.width} × ${m.height}` : '–'}</b> in <b>{m ? Math.round(m.milliseconds) : '–'}</b> ms
          </span>
        )}
      </span>
      {status_open.value && s && (
        <span class="status-line">
          {s.iterations > 0 && (
            <span>
              iteration <b data-testid="status-iteration">{count(s.iteration)}</b>
            </span>
          )}
          <span>
            <b>
              {[s.surfels.main, s.surfels.environment]
                .filter((n) => n > 0)
                .map(count)
                .join(' + ') || '0'}
            </b>{' '}
            surfels
          </span>
          <span>
            <b>{s.viewers}</b> {s.viewers === 1 ? 'viewer' : 'viewers'}
          </span>
          <span>{hello.value?.device}</span>
        </span>
      )}
    </button>
  );
}
