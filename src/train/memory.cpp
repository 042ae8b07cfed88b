#include "train/memory.h"

#include <algorithm>

#include "base/machine.h"
#include "math/spherical_harmonics.h"
#include "ops/lpips/lpips.h"

namespace traceflow {

namespace {

constexpr int64_t mebibyte = 1 << 20;
// The parameter, its gradient and two moments, and three more while rows are edited or a checkpoint is
// written.
constexpr int64_t copies_of_parameters = 7;
// Tensors with one number per pixel in a frame, its gradient and the saved state of the ops, including tile
// lists on the CPU.
constexpr int64_t planes_of_a_frame = 160;
// The saved hits of a ray and their gradient records on the CPU, where they are not limited.
constexpr int64_t bytes_per_ray = 64 * 48;
// A ray's place in the order, its sums and its basis on the CUDA device.
constexpr int64_t device_bytes_per_ray = 320;
// An entry of a tile list with its keys and its part of the gradient, and the number of tiles per surfel.
constexpr int64_t device_bytes_per_entry = 192;
constexpr int64_t entries_per_surfel = 8;
// The node, disk and keys of a surfel in the tracer's hierarchy, and its sums.
constexpr int64_t device_bytes_per_disk = 640;
// For the matrix library, the sums of the fields, the segments in which points pass through them, and small
// lists.
constexpr int64_t device_bytes_of_ops = 512 * mebibyte;

struct SetShape {
  int degree;
  bool has_field;
  const NetworkOptions& network;
};

int64_t bytes_per_surfel(const SetShape& set) {
  const int64_t numbers = 3 + 2 + 4 + 1 + 1 + 1 + 3 * sh_coefficients(set.degree);
  const int64_t posed = 2 * numbers;
  const int64_t screen = 128;
  const int64_t encoding = set.has_field ? set.network.encoding_size() : 0;
  return 4 * (copies_of_parameters * numbers + posed + screen + encoding);
}

// The kept activations of a field at `count` points.
int64_t field_bytes(const SetShape& set, int64_t count, const KeptMemory& kept) {
  if (!set.has_field) return 0;
  const int64_t each = 4 * static_cast<int64_t>(set.network.depth + 1) * set.network.width;
  return std::min(each * count, kept.field_bytes);
}

// For a grid whose box is a cube, which has the most points.
int64_t lighting_bytes(const LightingOptions& light, int64_t times) {
  if (light.cells == 0) return 0;
  const int64_t side = light.cells + 1;
  return 4 * copies_of_parameters * (times / light.every + 1) * side * side * side;
}

KeptMemory kept_memory(Device device, int64_t budget) {
  if (device == Device::cpu) return {};
  // What does not fit is recomputed, so that a run on a small device is slower instead of refused.
  return {.field_bytes = std::min(budget / 12, 4096 * mebibyte),
          .hit_bytes = std::min(budget / 6, 4096 * mebibyte)};
}

// The caps in the options.
SurfelCaps caps_of(const TrainOptions& options) {
  const bool traced = options.specular == Specular::environment_gaussians;
  return {options.density.max_surfels, traced ? options.environment_density.max_surfels : 0, false};
}

}  // namespace

int64_t largest_view(const Capture& capture) {
  int64_t pixels = 0;
  for (const auto* split : {&capture.train, &capture.test}) {
    for (const View& view : *split)
      pixels = std::max(pixels, int64_t{view.camera.width} * view.camera.height);
  }
  return pixels;
}

MemorySetting memory_setting(const TrainOptions& options, Device device, const Capture& capture) {
  return {options, device, largest_view(capture), static_cast<int64_t>(times_of(capture).size())};
}

int64_t forecast_bytes(const MemorySetting& run, const KeptMemory& kept, int64_t main, int64_t environment) {
  const TrainOptions& o = run.options;
  const int64_t pixels = run.pixels;
  const int64_t samples = int64_t{o.render.samples} * o.render.samples;  // per pixel
  const bool traced = o.specular == Specular::environment_gaussians;
  const bool mapped = o.specular == Specular::environment_map;
  const SetShape main_set{o.initial.sh_degree, o.deform.main, o.deform.network};
  const SetShape environment_set{o.initial.environment_sh_degree, o.deform.environment,
                                 o.deform.environment_network};
  int64_t bytes = main * bytes_per_surfel(main_set) + environment * bytes_per_surfel(environment_set) +
                  field_bytes(main_set, main, kept) +
                  field_bytes(environment_set, mapped ? samples * pixels : environment, kept) +
                  4 * planes_of_a_frame * samples * pixels + o.capture.cache_mebibytes * mebibyte +
                  64 * mebibyte;
  const int64_t side = mapped ? o.initial.map_size : o.initial.far_size;
  if (o.specular != Specular::none) bytes += 4 * copies_of_parameters * 6 * 3 * side * side;
  if (o.deform.kind == "nodes") bytes += lighting_bytes(o.deform.lighting, run.times);
  if (o.loss.lpips > 0) bytes += lpips::network_bytes + pixels * lpips::gradient_bytes_per_pixel;
  if (run.device == Device::cpu) return bytes + (traced ? samples * pixels * bytes_per_ray : 0);
  bytes += device_bytes_of_ops + main * samples * entries_per_surfel * device_bytes_per_entry;
  if (traced)
    bytes += environment * device_bytes_per_disk + samples * pixels * device_bytes_per_ray + kept.hit_bytes;
  return bytes;
}

int64_t available_bytes(Device device) {
  return device == Device::cuda ? static_cast<int64_t>(cuda::facts().free_bytes) : memory_available();
}

int64_t memory_budget_bytes(const TrainOptions& options, Device device) {
  return options.memory_budget > 0 ? options.memory_budget * mebibyte : available_bytes(device) / 4 * 3;
}

MemoryPlan plan_memory(const MemorySetting& run) {
  const TrainOptions& o = run.options;
  MemoryPlan plan;
  plan.budget_bytes = memory_budget_bytes(o, run.device);
  plan.kept = kept_memory(run.device, plan.budget_bytes);
  plan.image_bytes = o.capture.cache_mebibytes * mebibyte;
  const SurfelCaps asked = caps_of(o);
  if (const int64_t fixed = forecast_bytes(run, plan.kept, 0, 0); fixed >= plan.budget_bytes) {
    throw InputError("option", "memory_budget", number_text(plan.budget_bytes / mebibyte) + " MiB",
                     "more than " + number_text(fixed / mebibyte) + " MiB for images of this size",
                     "raise it, use --downscale, or lower capture.cache_mebibytes");
  }
  const auto caps = [&](double share) {
    return SurfelCaps{static_cast<int64_t>(share * static_cast<double>(asked.main)),
                      static_cast<int64_t>(share * static_cast<double>(asked.environment)), share < 1};
  };
  const auto fits = [&](const SurfelCaps& sizes) {
    return forecast_bytes(run, plan.kept, sizes.main, sizes.environment) <= plan.budget_bytes;
  };
  plan.caps = asked;
  if (!fits(plan.caps)) {
    // The limits on kept memory make the forecast nonlinear, so the share is found by bisection.
    double low = 0, high = 1;
    constexpr int halvings = 24;
    for (int i = 0; i < halvings; ++i) (fits(caps((low + high) / 2)) ? low : high) = (low + high) / 2;
    plan.caps = caps(low);
  }
  plan.forecast_bytes = forecast_bytes(run, plan.kept, plan.caps.main, plan.caps.environment);
  return plan;
}

MemoryPlan with_caps(MemoryPlan plan, const MemorySetting& run, const SurfelCaps& caps) {
  const SurfelCaps asked = caps_of(run.options);
  plan.caps = {caps.main, caps.environment, caps.main < asked.main || caps.environment < asked.environment};
  plan.forecast_bytes = forecast_bytes(run, plan.kept, caps.main, caps.environment);
  return plan;
}

TrainOptions limited_to(const SurfelCaps& caps, TrainOptions options) {
  const auto limit = [](int& count, int64_t cap) {
    count = static_cast<int>(std::clamp<int64_t>(cap, 1, count));
  };
  limit(options.density.max_surfels, caps.main);
  limit(options.environment_density.max_surfels, caps.environment);
  return options;
}

std::string lowered_caps_warning(const SurfelCaps& caps) {
  if (!caps.lowered) return "";
  return "the memory budget holds " + std::to_string(caps.main) + " main and " +
         std::to_string(caps.environment) + " environment surfels at most";
}

std::string resumed_plan_warning(const MemoryPlan& plan, int64_t available) {
  if (plan.forecast_bytes <= available) return "";
  const auto mebibytes = [](int64_t bytes) { return std::to_string(bytes / mebibyte) + " MiB"; };
  return "the run may take " + mebibytes(plan.forecast_bytes) + ", as when it began, and " +
         mebibytes(available) + " are free now; --memory-budget makes it smaller, and its end another";
}

std::string out_of_memory_advice(bool half_updated, bool has_checkpoint) {
  if (!half_updated) return "; --resume goes on when there is room, or with a lower --memory-budget";
  const std::string lost = ", in the middle of a change that is not saved; ";
  return lost + (has_checkpoint ? "--resume goes on from the checkpoint before when there is room, or with a "
                                  "lower --memory-budget"
                                : "begin again when there is room, or with a lower --memory-budget");
}

int64_t unlimited_forecast(const MemorySetting& run) {
  TrainOptions options = run.options;
  options.memory_budget = mebibyte * 1024;  // a pebibyte
  return plan_memory({options, run.device, run.pixels, run.times}).forecast_bytes;
}

}  // namespace traceflow
