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
            "Length in which the schedule's marks are counted; runs scale them.");
    v.field("deform_from", deform_from, "iteration", "The main field starts (method §7.1).");
    v.field("normal_from", normal_from, "iteration", "The normal losses start (method §7.1).");
    v.field("specular_from", specular_from, "iteration",
            "Phase 2: the environment trains alone (method §7.2).");
    v.field("joint_from", joint_from, "iteration", "Phase 3: everything trains (method §7.3).");
    v.field("sh_every", sh_every, "iterations",
            "The harmonics' degree grows by one this often (method §7.6).");
    v.field("time_jitter", time_jitter, "frames",
            "Noise on the time at the start, annealed to zero (method §7.6).");
    v.field("time_jitter_until", time_jitter_until, "iteration", "Where the noise on the time ends.");
    v.field("first_times", first_times, "",
            "Share of the capture's duration, from its start, whose views are trained on at first.");
    v.field("all_times_from", all_times_from, "iteration",
            "The share has grown to the whole duration, in proportion to the iterations.");
    v.field("samples_from", samples_from, "iteration",
            "From where on pixels have the samples of render.samples, before it one.");
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
    v.field("position", position, "extents", "Positions, first iteration.");
    v.field("position_end", position_end, "extents", "Positions, last iteration (log-linear between).");
    v.field("sh", sh, "", "Harmonics of degree 0.");
    v.field("sh_rest_divisor", sh_rest_divisor, "", "Higher harmonics learn this many times slower.");
    v.field("opacity", opacity, "", "Opacity logits.");
    v.field("log_scale", log_scale, "", "Log-scales.");
    v.field("rotation", rotation, "", "Quaternions.");
    v.field("tint", tint, "", "Specular-tint logits.");
    v.field("roughness", roughness, "", "Logits of the roughness (initial.roughness).");
    v.field("field", field, "", "Residual fields, first iteration.");
    v.field("field_end", field_end, "", "Residual fields, last iteration (log-linear between).");
    v.field("motion", motion, "radians", "Poses of bodies, first iteration; shifts in extents.");
    v.field("motion_end", motion_end, "radians",
            "Poses of bodies, last iteration, of longer runs the 8,000th (log-linear, and on beyond it).");
    v.field("lighting", lighting, "", "Logarithms of brightness (deform.lighting).");
    v.field("map", map, "", "Environment map, first iteration.");
    v.field("map_end", map_end, "", "Environment map, last iteration (log-linear between).");
    v.field("camera", camera, "radians",
            "Poses of training cameras, first iteration, of the last a hundredth (log-linear); shifts in "
            "extents. 0: they stay as the capture has them (not in the paper).");
    v.field("beta1", beta1, "", "Adam's decay of the first moment.");
    v.field("beta2", beta2, "", "Adam's decay of the second moment.");
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
    v.field("ssim", ssim, "", "Share of 1 - SSIM in the photometric loss; L1 takes the rest (method §7.4).");
    v.field("normal", normal, "", "Normal consistency L_norm (method §7.4).");
    v.field("normal_prior", normal_prior, "",
            "Agreement with the capture's normal priors, L_tc-norm (method §7.4).");
    v.field("normal_prior_on_mirrors", normal_prior_on_mirrors, "",
            "Factor on normal priors where the tint is 1; it is 1 where the tint is 0 and while bodies are "
            "followed (not in the paper).");
    v.field("distortion", distortion, "", "Depth distortion (method §7.4).");
    v.field("rigidity", rigidity, "",
            "Neighbouring main surfels keep their distances while the field moves them (not in the paper).");
    v.field("rigidity_strain", rigidity_strain, "",
            "Relative stretch from which neighbours count as parted.");
    v.field("silhouette", silhouette, "",
            "Bodies cover what the capture's masks cover (deform.kind = nodes; not in the paper).");
    v.field(
        "environment_residual", environment_residual, "",
        "The environment stays as it is where no photograph needs it to change: the mean norm of what its "
        "field adds to a surfel (not in the paper).");
    v.field("lpips", lpips, "", "Perceptual distance LPIPS, late in training (method §7.4).");
    v.field("lpips_from", lpips_from, "iteration", "Where that starts.");
    v.field("lpips_weights", lpips_weights, "",
            "The network's weights, as scripts/export_lpips.py writes them.");
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
  int prune_above_from = 3000;
  int opacity_reset_every = 3000;
  float opacity_reset = 0.01F;
  int max_surfels = 300000;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("from", from, "iteration", "First density control.");
    v.field("every", every, "iterations", "Interval of density control.");
    v.field("until", until, "iteration", "Where density control ends.");
    v.field("gradient_threshold", gradient_threshold, "",
            "Mean centre gradient above which a surfel multiplies.");
    v.field("clone_below", clone_below, "extents",
            "Largest scale up to which it is cloned; above, it is split.");
    v.field("clones_share_opacity", clones_share_opacity, "",
            "A cloned surfel and its clone become so faint that together they cover what the surfel did.");
    v.field("growth", growth, "",
            "At most this share of the set multiplies at a time, the strongest signals first.");
    v.field("prune_opacity", prune_opacity, "", "Surfels fainter than this go.");
    v.field("prune_above", prune_above, "extents", "Surfels wider than this go.");
    v.field(
        "prune_above_cloud", prune_above_cloud, "clouds",
        "Likewise, in radii of the cloud of points; of the environment, in halves of its box's diagonal.");
    v.field("longest_needle", longest_needle, "clouds",
            "Standard deviation that a surfel more than ten times as long as wide has at most; in the same "
            "radii. 0: any.");
    v.field("prune_above_from", prune_above_from, "iteration", "From where on the wide ones go.");
    v.field("opacity_reset_every", opacity_reset_every, "iterations",
            "Interval of opacity resets; 0 for none. None either where half of it, in the run's own "
            "iterations, is under \"every\": opacities could not recover.");
    v.field("opacity_reset", opacity_reset, "", "Opacity that a reset leaves at most.");
    v.field("max_surfels", max_surfels, "surfels", "Hard cap on the set's size.");
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
            "Cells of the grid along the longest side of the box around bodies; 0: the light stays.");
    v.field("every", every, "times", "Brightness changes from one of so many times to the next.");
    v.field("bodies", bodies, "", "Light on bodies changes too.");
    v.field("size", size, "", "Weight of the loss on brightness other than 1.");
    v.field("haste", haste, "", "Weight of the loss that keeps brightness slow.");
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
            "How main surfels move: network (a residual field), or nodes (bodies, which masks or the film "
            "show, are tracked and bend where they must; of all else the field moves what is seen to move; "
            "network where there are none).");
    v.field("main", main, "", "The main surfels move.");
    v.field("environment", environment, "", "The environment moves.");
    v.field("find", find, "iterations",
            "Without masks: training of a still scene that finds what moves, at most two fifths of the run "
            "(kind = nodes); 0: nothing is looked for.");
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
    v.field("max_points", max_points, "points", "At most this many of the capture's points become surfels.");
    v.field("sh_degree", sh_degree, "", "Degree of the main surfels' harmonics.");
    v.field("environment_sh_degree", environment_sh_degree, "", "Degree of the environment's harmonics.");
    v.field("opacity", opacity, "", "First opacity of main surfels.");
    v.field("tint", tint, "", "First specular tint; short schedules want 0.1.");
    v.field(
        "tint_in_mask", tint_in_mask, "",
        "First tint of surfels that the capture's masks show on the moving object; 0: masks do not matter.");
    v.field("tint_outside_mask", tint_outside_mask, "", "Then the first tint of the others.");
    v.field(
        "roughness", roughness, "",
        "First roughness of mirrors: the standard deviation of the directions that one is mirrored into, as "
        "a tangent; under 0.25. 0: all are perfect mirrors, as in the paper. With "
        "specular=environment-map it has no effect (method §4.5).");
    v.field("colours_from_views", colours_from_views, "",
            "First colours from photographs near time 0, else grey.");
    v.field("normals_from_points", normals_from_points, "",
            "First orientation from neighbouring points, else random.");
    v.field("environment_cells", environment_cells, "cells",
            "Cells along each side of the environment's box.");
    v.field("environment_per_cell", environment_per_cell, "surfels", "Environment surfels in each cell.");
    v.field("environment_opacity", environment_opacity, "", "First opacity of environment surfels.");
    v.field("environment_box", environment_box, "", "Size of that box, in boxes around cameras and points.");
    v.field("environment_points", environment_points, "points",
            "So many of the capture's points outside its masks start as environment surfels too.");
    v.field("far_size", far_size, "texels",
            "Side of a face of the cube map behind the environment surfels; 0: none (method §5.4).");
    v.field("map_size", map_size, "texels", "Side of a face of the environment map.");
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
            "Length of the run; every mark of the schedule scales with it.");
    v.field("seed", seed, "", "Seed of every random choice.");
    v.field("specular", specular, "",
            "Where reflections come from: none, environment-gaussians, environment-map.");
    v.field("memory_budget", memory_budget, "MiB",
            "Memory that the run may take on its device; 0 for three quarters of what is free.");
    v.field("save_every", save_every, "iterations", "Interval of checkpoints.");
    v.field("non_finite", non_finite, "",
            "A gradient that is not finite stops the run, or is dropped and counted.");
    v.field("collapse_decibels", collapse_decibels, "dB",
            "Fall of the mean PSNR under its best that ends the run; 0: never.");
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
