import { batch, effect, signal } from '@preact/signals';
import type { Hello, PathReply, ProbeReply, Refused, Reply, Request } from '../messages.ts';
import { Connection } from '../net/connection.ts';
import type { Picture } from '../net/wire.ts';
import { History } from './history.ts';
import { asleep, camera, events, hello, layer, link, map, notify, photo, pivot, server, time, warning } from './store.ts';

// The one connection of the page, and who is told what comes over it.

export interface Handlers {
  picture(picture: Picture): void;
  probe(reply: ProbeReply): void;
  refused(reply: Refused): void;
  path(reply: PathReply): void;
  greeted(): void; // Hello was taken in: all must be asked for again
}

let connection: Connection | null = null;
let history = new History();
const told = signal(0); // messages that went into it

// Nothing is worked out from the events while nobody looks.
effect(() => {
  if (!asleep.value && told.value > 0) events.value = history.list();
});

export const send = (request: Request): boolean => connection?.send(request) ?? false;
export const retry_now = (): void => connection?.retry_now();

export function start_connection(handlers: Handlers): void {
  connection = new Connection({
    link: (now) => (link.value = now),
    reply: (reply) => batch(() => take(reply, handlers)),
    picture: handlers.picture,
    too_long: (request) =>
      notify(
        request.type === 'path'
          ? 'This camera path is too long to be shown here; it can still be exported and rendered.'
          : 'This is too long for the server.',
      ),
  });
}

function take(reply: Reply, handlers: Handlers): void {
  switch (reply.type) {
    case 'hello':
      greet(reply);
      return handlers.greeted();
    case 'state':
      server.value = reply;
      return;
    case 'events':
      if (reply.reset) history = new History();
      for (const event of reply.events) history.add(event);
      told.value++;
      return;
    case 'warning':
      warning.value = reply.text;
      return;
    case 'refused':
      notify(reply.text);
      return handlers.refused(reply);
    case 'probe':
      return handlers.probe(reply);
    case 'path':
      return handlers.path(reply);
  }
}

// After a reconnection to the same scene the user's view is kept; anything else starts from the server's.
function greet(next: Hello): void {
  const before = hello.value;
  hello.value = next;
  warning.value = '';
  const same = before?.name === next.name && before.source === next.source && camera.value !== null;
  if (!same) look_from_start();
  if (!next.layers.some((l) => l.name === layer.value)) layer.value = next.layers[0]?.name ?? 'rgb';
  if (!next.maps.includes(map.value)) map.value = next.maps[0] ?? '';
  if (photo.value && !next.cameras[photo.value.split][photo.value.index]) photo.value = null;
}

export function look_from_start(): void {
  const there = hello.value;
  if (!there) return;
  photo.value = null;
  camera.value = there.start;
  pivot.value = there.target;
  if (!there.moves) time.value = 0;
}
