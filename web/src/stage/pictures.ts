import type { Camera, FrameHeader, PhotoHeader, PhotoRef, ViewRequest } from '../messages.ts';
import { radians } from '../math/camera.ts';
import { fit, type Rectangle } from '../math/fit.ts';
import { picture_blob, type Picture } from '../net/wire.ts';
import { camera, captured, comparing, photo, pixel_ratio, shown, split_at, stage } from '../state/store.ts';
import { send } from '../state/server.ts';
import { widened } from '../math/camera.ts';
import { count_frame } from './measures.ts';
import { view_requester } from './view_requests.ts';

// Frames and photographs as they come, and the canvas that they are painted on.

interface Frame {
  bitmap: ImageBitmap;
  header: FrameHeader;
  view: ViewRequest;
}

interface Photograph {
  bitmap: ImageBitmap;
  ref: PhotoRef;
}

let canvas: HTMLCanvasElement | null = null;
let frame: Frame | null = null;
let photograph: Photograph | null = null;
let asked: string = ''; // which photograph, and how wide

export function use_canvas(element: HTMLCanvasElement): void {
  canvas = element;
  paint();
}

export async function show_frame(picture: Picture & { header: FrameHeader }): Promise<void> {
  const { header } = picture;
  const first = view_requester.answer(header);
  const sent = view_requester.find(header.view);
  const bitmap = await decoded(picture);
  send({ type: 'frame_shown', frame: header.frame });
  if (!bitmap || !sent || (frame && header.frame < frame.header.frame && header.view <= frame.view.id)) return;
  frame?.bitmap.close();
  frame = { bitmap, header, view: sent.view };
  paint();
  count_frame(header, first);
}

export async function show_photograph(picture: Picture & { header: PhotoHeader }): Promise<void> {
  const bitmap = await decoded(picture);
  if (!bitmap) return;
  photograph?.bitmap.close();
  photograph = { bitmap, ref: { split: picture.header.split, index: picture.header.index } };
  paint();
}

// A picture that cannot be decoded is left out: the next one will come.
async function decoded(picture: Picture): Promise<ImageBitmap | null> {
  try {
    return await createImageBitmap(picture_blob(picture));
  } catch {
    return null;
  }
}

// Asks for the photograph that the comparison needs, unless it is here or under way.
export function request_photograph(): void {
  const ref = photo.value;
  const view = captured(ref);
  if (!ref || !view || (comparing.value !== 'split' && comparing.value !== 'photo')) return;
  const width = Math.min(view.width, Math.round(fit(view.width / view.height, stage.value).width * pixel_ratio.value));
  const name = `${ref.split} ${ref.index} ${width}`;
  if (asked === name) return;
  asked = name;
  send({ type: 'photo', ...ref, width });
}

export const forget_request = (): void => void (asked = '');

const same = (a: PhotoRef | null | undefined, b: PhotoRef | null | undefined): boolean =>
  !!a && !!b && a.split === b.split && a.index === b.index;

// Where a frame belongs on the stage: a captured view's as large as fits; any other so that its angles agree with the
// stage's.
function place_of(drawn: Frame): Rectangle {
  const aspect = drawn.header.width / drawn.header.height;
  const sent = drawn.view.camera;
  const now = camera.value;
  if (!sent || !now) return fit(aspect, stage.value);
  const wanted = widened(now, stage.value.width / stage.value.height);
  const height = (stage.value.height * tangent(sent)) / tangent(photo.value ? sent : wanted);
  const width = height * aspect;
  return { left: (stage.value.width - width) / 2, top: (stage.value.height - height) / 2, width, height };
}

const tangent = (c: Camera): number => Math.tan(radians(c.fov_y) / 2);

export function paint(): void {
  const context = canvas?.getContext('2d', { alpha: false });
  if (!canvas || !context) return;
  const ratio = pixel_ratio.value;
  const width = Math.round(stage.value.width * ratio);
  const height = Math.round(stage.value.height * ratio);
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  context.fillStyle = getComputedStyle(canvas).backgroundColor;
  context.fillRect(0, 0, width, height);
  if (!frame) return;
  const place = place_of(frame);
  const x = Math.round(place.left * ratio);
  const y = Math.round(place.top * ratio);
  const w = Math.round((place.left + place.width) * ratio) - x;
  const h = Math.round((place.top + place.height) * ratio) - y;
  context.imageSmoothingQuality = 'high';
  context.drawImage(frame.bitmap, x, y, w, h);
  if (photograph && same(photograph.ref, photo.value) && same(photograph.ref, frame.view.photo)) {
    const share = comparing.value === 'photo' ? 1 : comparing.value === 'split' ? split_at.value : 0;
    const { bitmap } = photograph;
    const cut = Math.round(w * share);
    if (cut > 0) context.drawImage(bitmap, 0, 0, (bitmap.width * cut) / w, bitmap.height, x, y, cut, h);
  }
  show_place(frame, place);
}

function show_place(drawn: Frame, place: Rectangle): void {
  const ref = drawn.view.photo ?? null;
  const from = drawn.view.camera ?? captured(ref);
  if (!from) return;
  const aspect = drawn.header.width / drawn.header.height;
  shown.value = { camera: from, photo: ref, aspect, place, time: drawn.view.time, frame: drawn.header.frame };
}
