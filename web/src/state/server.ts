import { batch } from '@preact/signals';
import type { Hello, PathReply, ProbeReply, Refused, Reply, Request } from '../messages.ts';
import { Connection } from '../net/connection.ts';
import type { Picture } from '../net/wire.ts';
import { camera, events, hello, layer, link, map, notify, photo, pivot, server, time, trouble } from './store.ts';

// The one connection of the page, and who is told what comes over it.

export interface Handlers {
  picture(picture: Picture): void;
  probe(reply: ProbeReply): void;
  refused(reply: Refused): void;
  path(reply: PathReply): void;
  greeted(): void; // Hello was taken in: all must be asked for again
}

let connection: Connection | null = null;

export const send = (request: Request): boolean => connection?.send(request) ?? false;
export const retry_now = (): void => connection?.retry_now();

export function start_connection(handlers: Handlers): void {
  connection = new Connection({
    link: (now) => (link.value = now),
    reply: (reply) => batch(() => take(reply, handlers)),
    picture: handlers.picture,
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
      events.value = reply.reset ? reply.events : [...events.value, ...reply.events];
      return;
    case 'trouble':
      trouble.value = reply.text;
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
  trouble.value = '';
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
