#pragma once

#include <string>

#include "base/random.h"
#include "files/safetensors.h"
#include "record/events.h"
#include "scene/rows.h"
#include "train/optimiser.h"
#include "train/options.h"

namespace traceflow {

// How large a scene is, in its own units.
struct SceneSize {
  float extent;  // of the cameras (method §7.6)
  float cloud;   // radius of the capture's points
};

// What a set is held to at one density control.
struct DensityLimits {
  SceneSize size;
  int64_t cap;               // the most surfels there may be
  bool prunes_large = true;  // whether those that are too wide go,
  bool prunes_faint = true;  // and those that are too faint
};

// Density control of one set of surfels (method §7.7): surfels whose centre gradient is large multiply, the
// faint and the oversized go, and the count never passes the cap.
class DensityControl {
 public:
  // set: "main" or "environment", for events and checkpoints. device: where the surfels are.
  DensityControl(std::string set, const DensityOptions& options, int64_t count, Device device = Device::cpu)
      : set_(std::move(set)), options_(options), sum_({count}, device), seen_({count}, device) {}

  // Adds an iteration's signal (N) of the surfels that it touched (N flags). Asks for no memory.
  void accumulate(const Tensor<float>& signal, const Tensor<uint8_t>& touched);

  // Clones, splits and prunes; forgets the statistics. What becomes of each surfel is decided on the host;
  // rows move where they are.
  events::DensityChanged update(Surfels& surfels, SurfelMoments& moments, const DensityLimits& limits,
                                Random& random);

  // Adds new surfels, which are on the CPU; their statistics and moments start from zero.
  events::DensityChanged add(Surfels& surfels, SurfelMoments& moments, const Surfels& more);

  // Shortens needles: surfels more than ten times as long as wide and longer than options.longest_needle. A
  // needle that a few views see end on looks right to them and reaches through the air. 0: none are. Asks for
  // no memory.
  void shorten_needles(Surfels& surfels, float cloud) const;

  // Lowers every opacity to at most options.opacity_reset and clears that group's moments.
  void reset_opacity(Surfels& surfels, SurfelMoments& moments) const;

  void put(Safetensors& file) const;
  void get(const Safetensors& file);

 private:
  enum class Fate : uint8_t { keep, clone, split, prune_transparent, prune_large };
  std::vector<Fate> fates(const Surfels& surfels, const DensityLimits& limits, bool& at_cap) const;

  std::string set_;
  DensityOptions options_;
  Tensor<float> sum_;   // N, sum of the signal
  Tensor<float> seen_;  // N, iterations that touched the surfel
};

}  // namespace traceflow
