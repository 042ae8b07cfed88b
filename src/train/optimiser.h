#pragma once

#include <string>
#include <vector>

#include "files/safetensors.h"
#include "ops/optimize/adam.h"
#include "render/frame.h"
#include "scene/rows.h"
#include "train/schedule.h"

namespace traceflow {

// Adam's state for each field of a set of surfels.
struct SurfelMoments {
  optimize::AdamState position, log_scale, rotation, opacity_logit, sh, tint_logit, roughness_logit;

  // Calls f(name, state) for each field of surfels, in the order of for_each_field.
  template <class F>
  void for_each(F&& f) {
    for_each_field([&](const SurfelField& field, auto& state) { f(std::string(field.name), state); }, *this);
  }
  void reset_like(const Surfels& surfels);
  // New rows get zero moments (method §7.7).
  SurfelMoments edited(const PlacedEdit& edit) const;
};

// The number of gradient entries that were not finite, and the place of the first ("main.position, row 17").
struct NonFiniteGradients {
  int64_t count = 0;
  std::string first;
};

// A step of several tensors in one call that allocates no memory.
struct PreparedStep {
  struct Part {
    std::string name;
    int64_t row_size;
  };
  std::vector<Part> parts;  // the tensors
  std::vector<optimize::AdamTask> tasks;
  optimize::AdamOptions options;
  Tensor<optimize::LeftAlone> left_alone;  // one per tensor, on their device

  // rates: one for all, or one per column.
  void add(const std::string& name, Tensor<float>& parameter, const Tensor<float>& gradient,
           optimize::AdamState& state, std::vector<float> rates);
  void add(const std::string& name, Tensor<float>& parameter, const Tensor<float>& gradient,
           optimize::AdamState& state, double rate) {
    add(name, parameter, gradient, state, std::vector<float>{static_cast<float>(rate)});
  }
  NonFiniteGradients report() const;
};

// Updates a scene by Adam with the schedule's rates (method §7.6).
class Optimiser {
 public:
  // Zero moments with the shapes of the scene's tensors.
  explicit Optimiser(const Scene& scene);

  // Prepares a step for everything trainable: all that needs memory. Positions use share_of_positions of
  // their rate. The scene and its gradient must stay in place until step().
  void prepare(Scene& scene, const SceneGradient& gradient, const Trainable& trainable,
               const Schedule& schedule, const RateOptions& rates, int iteration,
               double share_of_positions = 1);
  // Makes the prepared step. Entries that are not finite change nothing. Allocates no memory, but the driver
  // may when it starts a kernel.
  void step();
  // What was not finite in the last step. Waits for the device.
  NonFiniteGradients non_finite() const { return step_.report(); }

  // For parameters that were added to the scene later.
  void begin(const Motion& motion);
  void begin(const Nodes& nodes);
  void begin(const Lighting& lighting);

  SurfelMoments& main() { return main_; }
  SurfelMoments& environment() { return environment_; }

  void put(Safetensors& file) const;
  // Throws InputError when the file's moments do not fit the scene that this optimiser was made for.
  void get(const Safetensors& file);

 private:
  // Calls f(name, state) for all states.
  template <class Self, class F>
  static void for_each(Self& self, F&& f);

  SurfelMoments main_, environment_;
  std::vector<optimize::AdamState> main_motion_, main_nodes_, lighting_;
  std::vector<optimize::AdamState> main_field_, environment_field_, map_field_;
  optimize::AdamState map_;
  PreparedStep step_;
};

}  // namespace traceflow
