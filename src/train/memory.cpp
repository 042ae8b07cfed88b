#include "train/memory.h"

#include <unistd.h>

#include <algorithm>

#include "math/spherical_harmonics.h"
#include "ops/lpips/lpips.h"

namespace traceflow {

namespace {

// Parameter, gradient, two moments, one copy while rows are edited, one in a checkpoint being written.
constexpr int64_t copies_of_parameters = 6;
// Tensors of one number a pixel that a frame, its gradient and the ops' saved state hold, tile lists
// included.
constexpr int64_t planes_of_a_frame = 160;
// A ray's saved hits and their gradient records.
constexpr int64_t bytes_per_ray = 64 * 48;
constexpr int64_t mebibyte = 1 << 20;

int64_t bytes_per_surfel(int degree, bool field, const NetworkOptions& network) {
  const int64_t numbers = 3 + 2 + 4 + 1 + 1 + 3 * sh_coefficients(degree);
  const int64_t posed = 2 * numbers;
  const int64_t screen = 128;
  const int64_t activations =
      field ? static_cast<int64_t>(network.depth + 1) * network.width + network.encoding_size() : 0;
  return 4 * (copies_of_parameters * numbers + posed + screen + activations);
}

}  // namespace

int64_t forecast_bytes(const TrainOptions& options, int64_t main, int64_t environment, int width,
                       int height) {
  const int64_t pixels = static_cast<int64_t>(width) * height;
  const int64_t perceptual =
      options.loss.lpips > 0 ? lpips::network_bytes + pixels * lpips::gradient_bytes_per_pixel : 0;
  const int64_t rays = options.specular == Specular::environment_gaussians ? pixels : 0;
  return main * bytes_per_surfel(options.initial.sh_degree, options.deform.main, options.deform.network) +
         environment * bytes_per_surfel(options.initial.environment_sh_degree, options.deform.environment,
                                        options.deform.environment_network) +
         4 * planes_of_a_frame * pixels + perceptual + rays * bytes_per_ray +
         options.capture.cache_mebibytes * mebibyte + 64 * mebibyte;
}

int64_t memory_budget_bytes(const TrainOptions& options) {
  if (options.memory_budget > 0) return options.memory_budget * mebibyte;
  const int64_t available = static_cast<int64_t>(sysconf(_SC_AVPHYS_PAGES)) * sysconf(_SC_PAGESIZE);
  return available / 4 * 3;
}

SurfelCaps surfel_caps(const TrainOptions& options, int width, int height) {
  const bool traced = options.specular == Specular::environment_gaussians;
  const int64_t main = options.density.max_surfels;
  const int64_t environment = traced ? options.environment_density.max_surfels : 0;
  const int64_t fixed = forecast_bytes(options, 0, 0, width, height);
  const int64_t wanted = forecast_bytes(options, main, environment, width, height) - fixed;
  const int64_t room = memory_budget_bytes(options) - fixed;
  if (room <= 0) {
    throw InputError("option", "memory_budget", number_text(memory_budget_bytes(options) / mebibyte) + " MiB",
                     "more than " + number_text(fixed / mebibyte) + " MiB for images of this size",
                     "raise it, or use --downscale");
  }
  if (wanted <= room) return {main, environment, false};
  const double share = static_cast<double>(room) / static_cast<double>(wanted);
  return {static_cast<int64_t>(share * static_cast<double>(main)),
          static_cast<int64_t>(share * static_cast<double>(environment)), true};
}

}  // namespace traceflow
