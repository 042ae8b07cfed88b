import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { link, notices, warning } from '../state/store.ts';
import { retry_now } from '../state/server.ts';
import { view_requester } from '../stage/view_requests.ts';

// What is wrong, in words, over the stage; and passing notices.
export function Banner() {
  const now = useSignal(Date.now());
  const slow = useSignal(false);
  useEffect(() => {
    const timer = setInterval(() => {
      now.value = Date.now();
      slow.value = view_requester.waiting() > 4000;
    }, 250);
    return () => clearInterval(timer);
  }, []);
  const state = link.value;
  return (
    <div class="banners" aria-live="polite">
      {state.kind === 'lost' && (
        <p class="banner wrong" data-testid="banner-lost">
          <span>
            The connection to the server is lost.{' '}
            <span aria-hidden="true">Next attempt in {seconds_until(state.retry_at, now.value)} s.</span>
          </span>
          <button type="button" class="button quiet" data-testid="retry" onClick={retry_now}>
            Try now
          </button>
        </p>
      )}
      {state.kind === 'connecting' && state.again && (
        <p class="banner wrong" data-testid="banner-lost">
          <span>The connection to the server is lost. Connecting…</span>
        </p>
      )}
      {state.kind === 'locked' && (
        <p class="banner wrong" data-testid="banner-locked">
          <span>
            Another server answers here and does not know this page. Open the address that its terminal printed.
          </span>
        </p>
      )}
      {warning.value && (
        <p class="banner wrong" data-testid="banner-warning">
          <span>{warning.value}</span>
        </p>
      )}
      {state.kind === 'open' && !warning.value && slow.value && (
        <p class="banner" data-testid="banner-slow">
          <span>The server is taking its time over the next picture.</span>
        </p>
      )}
      {notices.value.map((notice) => (
        <p key={notice.key} class="banner" data-testid="notice">
          <span>{notice.text}</span>
        </p>
      ))}
    </div>
  );
}

const seconds_until = (then: number, now: number): number => Math.max(0, Math.ceil((then - now) / 1000));
