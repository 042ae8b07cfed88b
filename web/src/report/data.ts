// What a report is made of: the JSON in <script type="application/json" id="report"> of the page, put there by
// `traceflow report` (src/eval/report_page.h).
import type { Machine, OpTime, TrainingEvent } from '../messages';

export interface Figures {
  psnr: number | null;
  ssim: number | null;
  lpips: number | null;
  lpips_published: number | null;
  masked_psnr: number | null;
  masked_ssim: number | null;
  core_psnr: number | null;
  normal_mae_deg: number | null;
  masked_normal_mae_deg: number | null;
  // Shares of the true depth.
  masked_depth_error_median: number | null;
  masked_depth_error_mean: number | null;
  core_depth_error_median: number | null;
  core_depth_error_mean: number | null;
  outside_depth_error_median: number | null;
  outside_depth_error_mean: number | null;
}

// How far a moving thing is followed (src/eval/motion_error.h); lengths in the capture's units.
export interface MotionFigures {
  moved: number | null;
  missed: number | null;
  share: number | null; // 1: not followed
  rotation_error_deg: number | null;
  scale: number | null;
  true_scale: number | null;
}

export interface ObjectMotion extends MotionFigures {
  object: number;
  points: number;
  followed_points: number;
  curve: ({ time: number } & MotionFigures)[]; // empty where the thing is not followed
}

export interface ReportData {
  version: string;
  made: string; // ISO 8601, UTC
  run: string; // name of the run's folder
  capture: string;
  split: 'test' | 'train';
  downscale: number;
  device: string;
  machine: Machine;
  iterations: number;
  train_seconds: number;
  render_fps: number | null;
  surfels: { main: number; environment: number; per_masked_pixel: number | null };
  mean: Figures;
  mean_aligned?: Figures; // with cameras from which the scene looks most like the photographs
  motion: { mean: MotionFigures; objects: ObjectMotion[] } | null; // null without truth
  views: ({ id: string; time: number } & Figures)[];
  settings: { path: string; value: string; default: string; unit: string; help: string }[];
  phases: { name: string; first: number; last: number; seconds: number; steps: OpTime[] }[];
  events: TrainingEvent[]; // of the log, steps thinned out
  // Views spread evenly over the split, as many as fit; each picture is a data: address of a JPEG.
  pictures: {
    id: string;
    width: number;
    height: number;
    photograph: string;
    rgb: string;
    difference: string;
    diffuse: string;
    specular: string;
    normal: string;
    depth: string;
  }[];
}
