// What the page and the server say to each other over /ws (docs/view.md). Lengths and axes are the capture's own, as in
// cameras.json and in camera paths: camera axes are x right, y down, z forward.

export type Vec3 = [number, number, number];

export interface Camera {
  position: Vec3;
  rotation: [Vec3, Vec3, Vec3]; // world_from_camera, rows
  fov_y: number; // whole vertical angle, degrees; the principal point is the middle
}

// A camera that took a photograph. Its principal point may lie off the middle, so the server makes its pictures itself:
// ask for it by PhotoRef.
export interface CapturedView extends Camera {
  id: string;
  time: number; // 0 to 1
  width: number;
  height: number;
  centre?: [number, number]; // principal point, as shares of width and height; without it the middle
}

export interface PhotoRef {
  split: 'train' | 'test';
  index: number; // in Hello.cameras
}

// What the server takes at most; src/serve/clients/messages.cpp and src/serve/net/limits.h have these too.
export const view_side = 4096; // pixels, width and height
export const still_side = 8192;
export const message_bytes = 64 * 1024; // a longer message ends the connection

// What to show from now on; the newest one counts. Coarse while `moving`, then finer up to width × height.
export interface ViewRequest {
  type: 'view';
  id: number; // rising; frames name it
  camera?: Camera; // this or photo
  photo?: PhotoRef; // exactly that view's camera; the picture has the photograph's aspect ratio
  time: number; // 0 to 1
  width: number; // device pixels at rest
  height: number;
  layer: string; // of Hello.layers; 'difference' needs photo
  exposure: number; // stops, of layers that are colours
  map: string; // of Hello.maps, for layers that are numbers
  moving: boolean;
}

// The page is hidden: nothing is rendered until the next ViewRequest.
export interface Sleep {
  type: 'sleep';
}

// A frame has been shown. The server sends no more than two frames ahead of these.
export interface FrameShown {
  type: 'frame_shown';
  frame: number;
}

// What the ray through a point of the last ViewRequest's picture meets.
export interface Probe {
  type: 'probe';
  id: number;
  x: number; // 0 (left) to 1
  y: number; // 0 (top) to 1
}

// The last ViewRequest's picture as a PNG of this size.
export interface Still {
  type: 'still';
  id: number;
  width: number;
  height: number;
}

export interface PhotoRequest extends PhotoRef {
  type: 'photo';
  width: number; // at most this wide
}

// A camera path's cameras, to preview it.
export interface PathRequest {
  type: 'path';
  id: number;
  path: CameraPath;
}

// While a training run is watched.
export interface Command {
  type: 'command';
  do: 'pause' | 'resume' | 'save' | 'stop';
}

// What the page sends, as JSON text.
export type Request = ViewRequest | Sleep | FrameShown | Probe | Still | PhotoRequest | PathRequest | Command;

// The file that `traceflow render --camera-path` takes.
export interface CameraPath {
  format: 'traceflow camera path';
  version: 1;
  width: number;
  height: number;
  fps: number;
  closed: boolean; // goes back to the first keyframe
  keyframes: Keyframe[];
}

export interface Keyframe extends Camera {
  time: number; // of the scene, 0 to 1
  seconds: number; // from here to the next keyframe
}

export interface Hello {
  type: 'hello';
  version: string;
  source: 'training' | 'run' | 'ply';
  name: string; // of the run's folder or the file
  capture: string; // empty where there is none
  device: string;
  moves: boolean; // whether time changes anything
  layers: { name: string; kind: 'colour' | 'number' }[];
  maps: string[]; // colour maps
  cameras: { train: CapturedView[]; test: CapturedView[] };
  start: Camera; // where to look from first
  target: Vec3; // what the cameras look at
  up: Vec3; // unit
  extent: number; // size of the scene
}

export interface State {
  type: 'state';
  paused: boolean;
  over: boolean; // the training has ended
  iteration: number;
  iterations: number; // 0 where nothing is trained
  surfels: { main: number; environment: number };
  viewers: number;
}

// Events of a training run, each as a line of log.jsonl is: first those of the past (steps thinned out), then live.
export interface Events {
  type: 'events';
  events: TrainingEvent[];
  reset: boolean; // drop what came before
}

export interface ProbeReply {
  type: 'probe';
  id: number;
  hit: boolean; // whether a surface is there; else the rest is absent
  surface?: Vec3;
  normal?: Vec3; // unit
  depth?: number;
  alpha?: number;
  tint?: number;
  colour?: Vec3;
  diffuse?: Vec3;
  specular?: Vec3;
  mirrored?: {
    direction: Vec3; // unit
    end: Vec3; // mean place that the ray's light comes from
    distance: number; // from the surface to there; 0 where it meets nothing
    alpha: number; // how much of the ray's light comes from surfels
  };
}

export interface PathReply {
  type: 'path';
  id: number;
  shots: { camera: Camera; time: number }[]; // one for each frame
}

// A request that could not be answered, in words.
export interface Refused {
  type: 'refused';
  request: string; // its type
  id: number; // its id, or 0
  text: string;
}

// Something is wrong on the server's side: the run's folder vanished, the device is out of memory. Empty text: it is over.
export interface Warning {
  type: 'warning';
  text: string;
}

// What the server sends as JSON text.
export type Reply = Hello | State | Events | ProbeReply | PathReply | Refused | Warning;

export interface FrameHeader {
  type: 'frame';
  frame: number; // for FrameShown
  view: number; // id of the ViewRequest that it answers
  width: number;
  height: number;
  final: boolean; // it will not get finer
  milliseconds: number; // that rendering and encoding took
  iteration: number;
  format: 'jpeg';
}

export interface StillHeader {
  type: 'still';
  id: number;
  width: number;
  height: number;
  format: 'png';
}

export interface PhotoHeader extends PhotoRef {
  type: 'photo';
  width: number;
  height: number;
  format: 'jpeg';
}

// What the server sends as bytes: length of the header (32 bit, little endian), header (JSON text), picture.
export type PictureHeader = FrameHeader | StillHeader | PhotoHeader;

export interface SurfelCounts {
  main: number;
  environment: number;
}

// A line of log.jsonl (docs/train.md).
export type TrainingEvent =
  | {
      event: 'started';
      capture: string;
      run: string;
      iteration: number;
      iterations: number;
      device: string;
      threads: number;
      seed: number;
      surfels: SurfelCounts;
      forecast_bytes: number;
      version?: string;
      machine?: Machine;
    }
  | {
      event: 'step';
      iteration: number;
      iterations: number;
      phase: string;
      loss: number;
      terms: Record<string, number>;
      psnr: number;
      seconds: number;
      rate: number;
      surfels: SurfelCounts;
      memory_bytes?: number; // resident; of the device where training is on one
    }
  | {
      event: 'density_changed';
      iteration: number;
      set: 'main' | 'environment';
      cloned: number;
      split: number;
      added?: number; // for surface that came into view; older logs tell none
      pruned_transparent: number;
      pruned_large: number;
      opacity_reset: boolean;
      at_cap: boolean;
      count: number;
    }
  | {
      event: 'following_decided';
      iteration: number;
      follows: boolean;
      silhouettes: number; // mean misfit at rest, a share of the masks' area
    }
  | { event: 'bodies_parted'; iteration: number; added: number; bodies: number }
  | {
      event: 'bending_decided';
      iteration: number;
      body: number;
      bends: boolean;
      silhouettes: number; // misfit over that of the first view
      photographs?: number; // what differs of them with nodes, over without; of textured bodies
    }
  | { event: 'priors_turned'; iteration: number; degrees: number }
  | { event: 'phase_entered'; iteration: number; phase: string }
  | { event: 'evaluated'; iteration: number; split: string; views: number; psnr: number; ssim: number; seconds: number }
  | { event: 'warning'; iteration: number; text: string }
  | { event: 'paused'; iteration: number; paused: boolean }
  | { event: 'saved'; iteration: number; path: string; seconds: number }
  | { event: 'measured'; iteration: number; phase: string; iterations: number; steps: OpTime[] }
  | {
      event: 'finished';
      ending: 'completed' | 'interrupted' | 'diverged' | 'out_of_memory' | 'no_input';
      iteration: number;
      seconds: number;
      psnr: number;
      surfels: SurfelCounts;
      reason: string;
    };

export interface Machine {
  processor: string;
  threads: number;
  memory_bytes: number;
  system: string;
  gpu: string; // empty where none is used
}

export interface OpTime {
  name: string;
  calls: number;
  seconds: number;
}
