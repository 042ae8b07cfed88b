#pragma once

#include <array>
#include <string>
#include <string_view>

#include "capture/capture.h"
#include "ops/optimize/adam.h"
#include "render/render_options.h"
#include "scene/scene.h"
#include "track/options.h"

// All options of the training method (method §7, §9).
namespace traceflow {

// Iteration numbers of the coarse-to-fine schedule (method §7.1–§7.3, §7.6) for a run of `length` iterations;
// runs of other lengths scale them in proportion.
struct ScheduleOptions {
  int length = 60000;
  int deform_from = 3000;
  int normal_from = 6000;
  int specular_from = 9000;
  int joint_from = 15000;
  int sh_every = 1000;
  float time_jitter = 0.1F;
  int time_jitter_until = 20000;
  float first_times = 1;
  int all_times_from = 0;
  int samples_from = 46500;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("length", length, "iterations",
            "Length of the run for which the iteration numbers of the schedule are given; other lengths "
            "scale them.");
    v.field("deform_from", deform_from, "iteration", "The main field starts (method §7.1).");
    v.field("normal_from", normal_from, "iteration", "The normal losses start (method §7.1).");
    v.field("specular_from", specular_from, "iteration",
            "Phase 2 starts: the environment trains, and the main surfels are frozen except their tint and "
            "roughness (method §7.2).");
    v.field("joint_from", joint_from, "iteration", "Phase 3 starts: everything trains (method §7.3).");
    v.field("sh_every", sh_every, "iterations",
            "Interval at which the degree of the spherical harmonics grows by one (method §7.6).");
    v.field("time_jitter", time_jitter, "frames",
            "Initial noise on the time; it falls to zero (method §7.6).");
    v.field("time_jitter_until", time_jitter_until, "iteration", "The noise on the time ends.");
    v.field("first_times", first_times, "",
            "Without bodies, training first uses only views from the start of the capture, up to this share "
            "of its duration.");
    v.field("all_times_from", all_times_from, "iteration",
            "Training uses all views from this iteration on; until then the share of the duration "
            "(schedule.first_times) grows linearly.");
    v.field(
        "samples_from", samples_from, "iteration",
        "From this iteration on, pixels have the samples of render.samples; before, they have one sample.");
  }
  void validate() const;
};

// Learning rates of Adam (method §7.6). Those of positions are relative to the scene's extent.
struct RateOptions {
  float position = 1.6e-4F;
  float position_end = 1.6e-6F;
  float sh = 2.5e-3F;
  float sh_rest_divisor = 20;
  float opacity = 0.05F;
  float log_scale = 5e-3F;
  float rotation = 1e-3F;
  float tint = 0.01F;
  float roughness = 0.01F;
  float field = 8e-4F;
  float field_end = 1.6e-6F;
  float motion = 5e-4F;
  float motion_end = 5e-5F;
  float lighting = 0.01F;
  float map = 0.016F;
  float map_end = 1.6e-4F;
  float camera = 0;
  float beta1 = 0.9F;
  float beta2 = 0.999F;
  float epsilon = 1e-15F;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("position", position, "extents", "Learning rate of positions, first iteration.");
    v.field("position_end", position_end, "extents",
            "Learning rate of positions, last iteration (log-linear between).");
    v.field("sh", sh, "", "Learning rate of the spherical harmonics of degree 0.");
    v.field("sh_rest_divisor", sh_rest_divisor, "",
            "The learning rate of higher degrees is that of degree 0 divided by this.");
    v.field("opacity", opacity, "", "Learning rate of opacity logits.");
    v.field("log_scale", log_scale, "", "Learning rate of log-scales.");
    v.field("rotation", rotation, "", "Learning rate of quaternions.");
    v.field("tint", tint, "", "Learning rate of specular-tint logits.");
    v.field("roughness", roughness, "", "Learning rate of roughness logits (initial.roughness).");
    v.field("field", field, "", "Learning rate of the residual fields, first iteration.");
    v.field("field_end", field_end, "",
            "Learning rate of the residual fields, last iteration (log-linear between).");
    v.field("motion", motion, "radians",
            "Learning rate of the poses of bodies, first iteration; translations in extents.");
    v.field("motion_end", motion_end, "radians",
            "Learning rate of the poses of bodies, last iteration, or the 8,000th of longer runs (log-linear "
            "between; it continues to fall after that).");
    v.field("lighting", lighting, "", "Learning rate of the logarithm of brightness (deform.lighting).");
    v.field("map", map, "", "Learning rate of the environment map, first iteration.");
    v.field("map_end", map_end, "",
            "Learning rate of the environment map, last iteration (log-linear between).");
    v.field("camera", camera, "radians",
            "Learning rate of the poses of training cameras, first iteration; a hundredth of it at the last "
            "iteration (log-linear between); translations in extents. 0: cameras are not refined (not in the "
            "paper).");
    v.field("beta1", beta1, "", "Adam's decay rate of the first moment.");
    v.field("beta2", beta2, "", "Adam's decay rate of the second moment.");
    v.field("epsilon", epsilon, "", "Adam's ε.");
  }
  void validate() const;
  optimize::AdamOptions adam() const { return {beta1, beta2, epsilon}; }
};

// Weights of the loss (method §7.4).
struct LossOptions {
  float ssim = 0.2F;
  float normal = 0.05F;
  float normal_prior = 0.05F;
  float normal_prior_on_mirrors = 1;
  float depth_prior = 0;
  int depth_prior_until = 30000;
  float distortion = 0;
  float rigidity = 0;
  float rigidity_strain = 0.2F;
  float silhouette = 0.3F;
  float environment_residual = 0;
  float lpips = 0;
  int lpips_from = 45000;
  std::string lpips_weights;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("ssim", ssim, "",
            "Weight of 1 - SSIM in the photometric loss; L1 has the remaining weight (method §7.4).");
    v.field("normal", normal, "", "Weight of the normal consistency L_norm (method §7.4).");
    v.field("normal_prior", normal_prior, "",
            "Weight of the agreement with the capture's normal priors, L_tc-norm (method §7.4).");
    v.field("normal_prior_on_mirrors", normal_prior_on_mirrors, "",
            "Factor on the weight of normal priors where the tint is 1; the factor is 1 where the tint is 0 "
            "and while bodies are tracked (not in the paper).");
    v.field(
        "depth_prior", depth_prior, "",
        "Initial weight of the agreement with the capture's depth priors (method §7.4; not in the paper).");
    v.field("depth_prior_until", depth_prior_until, "iteration",
            "The weight of depth priors, which falls linearly, reaches zero.");
    v.field("distortion", distortion, "", "Weight of the depth distortion (method §7.4).");
    v.field("rigidity", rigidity, "",
            "Weight of the loss that keeps the distances between neighbouring main surfels while the field "
            "moves them (not in the paper).");
    v.field("rigidity_strain", rigidity_strain, "",
            "Relative stretch above which neighbours count as separated.");
    v.field("silhouette", silhouette, "",
            "Weight of the loss that fits the silhouettes of bodies to the capture's masks (deform.kind = "
            "nodes; not in the paper).");
    v.field("environment_residual", environment_residual, "",
            "Weight of the mean norm of what the environment's field adds to a surfel; it keeps the "
            "environment constant unless photographs require a change (not in the paper).");
    v.field("lpips", lpips, "", "Weight of the perceptual distance LPIPS, late in training (method §7.4).");
    v.field("lpips_from", lpips_from, "iteration", "The LPIPS loss starts.");
    v.field("lpips_weights", lpips_weights, "",
            "File with the weights of the LPIPS network, as written by scripts/export_lpips.py.");
  }
  void validate() const;
};

// Density control of one set (method §7.7). Iteration numbers are for schedule.length iterations and scale
// with the run.
struct DensityOptions {
  int from = 500;
  int every = 100;
  int until = 30000;
  float gradient_threshold = 2e-4F;
  float clone_below = 0.01F;
  bool clones_share_opacity = false;
  float growth = 1;
  float prune_opacity = 0.05F;
  float prune_above = 0.1F;
  float prune_above_cloud = 1000;
  float longest_needle = 0;
  float longest_unseen = 0;
  int prune_above_from = 3000;
  int opacity_reset_every = 3000;
  float opacity_reset = 0.01F;
  int max_surfels = 300000;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("from", from, "iteration", "Density control starts.");
    v.field("every", every, "iterations", "Interval of density control.");
    v.field("until", until, "iteration", "Density control ends.");
    v.field("gradient_threshold", gradient_threshold, "",
            "Surfels whose mean centre gradient is above this are cloned or split.");
    v.field(
        "clone_below", clone_below, "extents",
        "Surfels to clone or split are cloned if their larger scale is at most this, and split otherwise.");
    v.field("clones_share_opacity", clones_share_opacity, "",
            "A cloned surfel and its clone get a lower opacity, so that together they cover as much as the "
            "one surfel did.");
    v.field("growth", growth, "",
            "Maximum share of the set that is cloned or split at a time, the strongest signals first.");
    v.field("prune_opacity", prune_opacity, "", "Surfels with a lower opacity are removed.");
    v.field("prune_above", prune_above, "extents", "Surfels with a larger scale are removed.");
    v.field("prune_above_cloud", prune_above_cloud, "clouds",
            "The same as prune_above, but in radii of the point cloud, or for the environment in halves of "
            "the diagonal of its box; the smaller limit counts.");
    v.field("longest_needle", longest_needle, "clouds",
            "Maximum standard deviation of surfels that are more than ten times as long as wide, in the unit "
            "of prune_above_cloud; 0: no limit.");
    v.field(
        "longest_unseen", longest_unseen, "clouds",
        "Maximum length by which a surfel of no body extends past the last point that a training view "
        "sees, towards the cameras, in the unit of prune_above_cloud; 0: no limit. For the main set only.");
    v.field("prune_above_from", prune_above_from, "iteration", "The removal of large surfels starts.");
    v.field("opacity_reset_every", opacity_reset_every, "iterations",
            "Interval of opacity resets; 0: no resets. There are also none if half the interval, in "
            "iterations of this run, is less than \"every\", because opacities could not recover.");
    v.field("opacity_reset", opacity_reset, "", "Maximum opacity after a reset.");
    v.field("max_surfels", max_surfels, "surfels", "Maximum number of surfels in the set.");
  }
  void validate(const std::string& group) const;
};

// How light changes: on static surfaces, for example by moving shadows, and on bodies (scene/lighting.h).
struct LightingOptions {
  int cells = 32;
  int every = 3;
  bool bodies = true;
  float size = 1e-7F;
  float haste = 1e-6F;
  float roughness = 1e-6F;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("cells", cells, "cells",
            "Number of grid cells along the longest side of the box around bodies; 0: the brightness is "
            "constant.");
    v.field("every", every, "times",
            "Brightness has values at every n-th frame, with linear interpolation between.");
    v.field("bodies", bodies, "", "The brightness of bodies changes too.");
    v.field("size", size, "", "Weight of the loss that keeps brightness near 1.");
    v.field("haste", haste, "", "Weight of the loss that keeps changes of brightness slow.");
    v.field("roughness", roughness, "", "Weight of the loss that keeps brightness smooth in space.");
  }
  void validate() const;
};

// Which fields there are, and their networks (method §1.2, §9).
struct DeformOptions {
  std::string kind = "network";
  bool main = true;
  bool environment = true;
  int find = 1000;
  TrackOptions track;
  BendOptions bend;
  LightingOptions lighting;
  NetworkOptions network;
  NetworkOptions environment_network;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("kind", kind, "",
            "How main surfels move: network (a residual field), or nodes (moving things in the masks or the "
            "video are tracked as bodies and deform if needed; the field moves only other surfels that are "
            "found to move; as network if there are no bodies).");
    v.field("main", main, "", "The main surfels can move.");
    v.field("environment", environment, "", "The environment can move.");
    v.field("find", find, "iterations",
            "Without masks: training of a static scene to find what moves, at most two fifths of the run "
            "(kind = nodes); 0: no search.");
    v.group("track", track);
    v.group("bend", bend);
    v.group("lighting", lighting);
    v.group("network", network);
    v.group("environment_network", environment_network);
  }
  void validate() const;
};

// How a scene starts (method §7.8).
struct InitialOptions {
  int max_points = 200000;
  int sh_degree = 3;
  int environment_sh_degree = 3;
  float opacity = 0.1F;
  float tint = 0.001F;
  float tint_in_mask = 0;
  float tint_outside_mask = 0.001F;
  float roughness = 0;
  bool colours_from_views = true;
  bool normals_from_points = true;
  int environment_cells = 32;
  int environment_per_cell = 5;
  float environment_opacity = 0.1F;
  float environment_box = 1.5F;
  int environment_points = 0;
  int far_size = 0;
  int map_size = 64;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("max_points", max_points, "points",
            "Maximum number of the capture's points that become main surfels.");
    v.field("sh_degree", sh_degree, "", "Degree of the main surfels' spherical harmonics.");
    v.field("environment_sh_degree", environment_sh_degree, "",
            "Degree of the environment's spherical harmonics.");
    v.field("opacity", opacity, "", "Initial opacity of main surfels.");
    v.field("tint", tint, "", "Initial specular tint; use 0.1 for short schedules.");
    v.field("tint_in_mask", tint_in_mask, "",
            "Initial tint of surfels inside the capture's masks of the moving object; 0: masks do not affect "
            "the tint.");
    v.field("tint_outside_mask", tint_outside_mask, "",
            "Initial tint of the other surfels, if initial.tint_in_mask is not 0.");
    v.field("roughness", roughness, "",
            "Initial roughness of mirrors: the standard deviation of the mirrored directions, as a tangent, "
            "under 0.25; 0: all are perfect mirrors, as in the paper. It has no effect with "
            "specular=environment-map (method §4.5).");
    v.field("colours_from_views", colours_from_views, "",
            "Initial colours are those of photographs near time 0; otherwise grey.");
    v.field("normals_from_points", normals_from_points, "",
            "Initial orientations are computed from neighbouring points; otherwise random.");
    v.field("environment_cells", environment_cells, "cells",
            "Number of cells along each side of the environment's box.");
    v.field("environment_per_cell", environment_per_cell, "surfels",
            "Number of environment surfels in each cell.");
    v.field("environment_opacity", environment_opacity, "", "Initial opacity of environment surfels.");
    v.field("environment_box", environment_box, "",
            "Size of the environment's box, relative to the box around cameras and points.");
    v.field("environment_points", environment_points, "points",
            "Maximum number of the capture's points outside its masks that also become environment surfels.");
    v.field("far_size", far_size, "texels",
            "Side length of a face of the cube map behind the environment surfels; 0: no cube map (method "
            "§5.4).");
    v.field("map_size", map_size, "texels", "Side length of a face of the environment map.");
  }
  void validate() const;
};

// What happens to a gradient that is not finite.
enum class NonFinite { stop, drop };
constexpr std::array<std::string_view, 2> enum_names(NonFinite) { return {"stop", "drop"}; }

struct TrainOptions {
  int iterations = 60000;
  int64_t seed = 1;
  Specular specular = Specular::environment_gaussians;
  int64_t memory_budget = 0;
  int save_every = 5000;
  NonFinite non_finite = NonFinite::stop;
  float collapse_decibels = 10;
  CaptureOptions capture;
  InitialOptions initial;
  DeformOptions deform;
  RenderOptions render;
  LossOptions loss;
  RateOptions rates;
  ScheduleOptions schedule;
  DensityOptions density;
  // The environment starts coarse throughout its box (method §7.8). If the camera moves little, a tenth of
  // its extent would remove nearly all surfels before they have trained. So the limit is relative to the box.
  DensityOptions environment_density{.from = 9000,
                                     .every = 500,
                                     .gradient_threshold = 1e-4F,
                                     .prune_above = 1000,
                                     .prune_above_cloud = 0.15F,
                                     .max_surfels = 200000};

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("iterations", iterations, "iterations",
            "Length of the run; all iteration numbers of the schedule scale with it.");
    v.field("seed", seed, "", "Seed of all random choices.");
    v.field("specular", specular, "",
            "Source of reflections: none, environment-gaussians, or environment-map.");
    v.field("memory_budget", memory_budget, "MiB",
            "Maximum memory of the run on its device; 0: three quarters of the free memory.");
    v.field("save_every", save_every, "iterations", "Interval of checkpoints.");
    v.field("non_finite", non_finite, "",
            "If a gradient is not finite: stop the run, or drop the gradient and count it.");
    v.field("collapse_decibels", collapse_decibels, "dB",
            "The run ends if the mean PSNR falls by more than this below its best value; 0: never.");
    v.group("capture", capture);
    v.group("initial", initial);
    v.group("deform", deform);
    v.group("render", render);
    v.group("loss", loss);
    v.group("rates", rates);
    v.group("schedule", schedule);
    v.group("density", density);
    v.group("environment_density", environment_density);
  }
  void validate() const;
};

// The presets: "paper" (60,000 iterations as published), "cpu" (two cores, a quarter of an hour at 240×135),
// "demo" (minutes). Throws InputError for another name.
TrainOptions preset(const std::string& name);

}  // namespace traceflow
