import { computed, effect, untracked } from '@preact/signals';
import { render } from 'preact';
import { App } from './App.tsx';
import { hide_token } from './net/token.ts';
import { start_requesting_views, view_requester } from './stage/view_requests.ts';
import { forget_request, paint, request_photograph, show_frame, show_photograph } from './stage/pictures.ts';
import { forget_probes, take_probe } from './state/rays.ts';
import { refuse_path, take_path } from './state/path.ts';
import { give_up_still, save_still } from './state/still.ts';
import { camera, comparing, hello, photo, pixel_ratio, split_at, stage } from './state/store.ts';
import { start_connection } from './state/server.ts';
import { repaint, start_theme } from './state/theme.ts';

hide_token();
start_theme();

start_connection({
  picture(picture) {
    const { header } = picture;
    if (header.type === 'frame') void show_frame({ ...picture, header });
    else if (header.type === 'photo') void show_photograph({ ...picture, header });
    else save_still(picture);
  },
  probe: take_probe,
  path: take_path,
  refused(reply) {
    if (reply.request === 'view') view_requester.refused(reply.id);
    if (reply.request === 'path') refuse_path(reply.id);
    // Without a request it is whatever was asked last: there were too many questions.
    if (reply.request === 'probe' || reply.request === '') forget_probes();
    if (reply.request === 'still' || reply.request === '') give_up_still();
  },
  greeted() {
    forget_request();
    forget_probes();
    give_up_still();
    view_requester.restart();
  },
});

start_requesting_views();
effect(request_photograph);
const angle = computed(() => camera.value?.fov_y);
effect(() => {
  void [repaint.value, stage.value, pixel_ratio.value, comparing.value, split_at.value, photo.value, angle.value];
  untracked(paint);
});
effect(() => {
  if (hello.value) document.title = `${hello.value.name} · TraceFlow`;
});

const root = document.getElementById('app');
if (root) render(<App />, root);
