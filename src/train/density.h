#pragma once

#include <string>

#include "base/random.h"
#include "files/safetensors.h"
#include "math/camera.h"
#include "record/events.h"
#include "scene/rows.h"
#include "train/optimiser.h"
#include "train/options.h"

namespace traceflow {

// The size of a scene, in scene units.
struct SceneSize {
  float extent;  // of the cameras (method §7.6)
  float cloud;   // radius of the capture's points
};

// The limits of a set in one density control.
struct DensityLimits {
  SceneSize size;
  int64_t cap;               // largest number of surfels
  bool prunes_large = true;  // remove surfels that are too large
  bool prunes_faint = true;  // remove surfels that are too faint
};

// Density control of one set of surfels (method §7.7). Surfels with a large centre gradient multiply, faint
// and oversized ones are removed, and the count never exceeds the cap.
class DensityControl {
 public:
  // set: "main" or "environment", for events and checkpoints. device: that of the surfels.
  DensityControl(std::string set, const DensityOptions& options, int64_t count, Device device = Device::cpu)
      : set_(std::move(set)), options_(options), sum_({count}, device), seen_({count}, device) {}

  // Adds the signal (N) of an iteration for the surfels that it touched (N flags). Allocates no memory.
  void accumulate(const Tensor<float>& signal, const Tensor<uint8_t>& touched);

  // Clones, splits and prunes, then resets the statistics. The decisions are made on the host; the rows are
  // edited on their device.
  events::DensityChanged update(Surfels& surfels, SurfelMoments& moments, const DensityLimits& limits,
                                Random& random);

  // Adds new surfels, which are on the CPU, with zero statistics and moments.
  events::DensityChanged add(Surfels& surfels, SurfelMoments& moments, const Surfels& more);

  // Shortens needles: surfels more than ten times as long as wide and longer than options.longest_needle (0:
  // none). A needle looks right in the few views that see it end-on, and sticks out in others. Allocates no
  // memory.
  void shorten_needles(Surfels& surfels, float cloud) const;

  // Shortens surfels of no body that extend, towards the cameras, into space that none of them sees: to at
  // most options.longest_unseen · cloud past the last point that one sees (0: no limit; method §7.7). Such a
  // surfel hides the scene from other views. cameras: of the training views, on the surfels' device.
  // Allocates no memory.
  void shorten_unseen(Surfels& surfels, const Tensor<Camera<float>>& cameras, float cloud) const;

  // Lowers every opacity to at most options.opacity_reset and sets the moments of the opacities to zero.
  void reset_opacity(Surfels& surfels, SurfelMoments& moments) const;

  void put(Safetensors& file) const;
  void get(const Safetensors& file);

 private:
  enum class Fate : uint8_t { keep, clone, split, prune_transparent, prune_large };
  std::vector<Fate> fates(const Surfels& surfels, const DensityLimits& limits, bool& at_cap) const;

  std::string set_;
  DensityOptions options_;
  Tensor<float> sum_;   // N, sum of the signal
  Tensor<float> seen_;  // N, number of iterations that touched the surfel
};

}  // namespace traceflow
