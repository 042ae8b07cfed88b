#pragma once

#include <string>
#include <vector>

#include "files/safetensors.h"
#include "ops/optimize/adam.h"
#include "render/frame.h"
#include "scene/rows.h"
#include "train/schedule.h"

namespace traceflow {

// Adam's state for each field of one set of surfels.
struct SurfelMoments {
  optimize::AdamState position, log_scale, rotation, opacity_logit, sh, tint_logit, roughness_logit;

  // f(name, state) for each field of surfels, in the order of for_each_field.
  template <class F>
  void for_each(F&& f) {
    for_each_field([&](const SurfelField& field, auto& state) { f(std::string(field.name), state); }, *this);
  }
  void reset_like(const Surfels& surfels);
  // Fresh rows get zero moments (method §7.7).
  SurfelMoments edited(const PlacedEdit& edit) const;
};

// Gradients that were not finite: how many, and where the first one was ("main.position, surfel 17").
struct NonFiniteGradients {
  int64_t count = 0;
  std::string first;
};

// What was not finite in a step, by the tensors that it went through, where they are.
struct StepNotes {
  struct Stepped {
    std::string name;
    int64_t row_size;
  };
  std::vector<Stepped> tensors;
  Tensor<optimize::LeftAlone> left_alone;  // one for each

  NonFiniteGradients report() const;
};

// Updates a scene by Adam with the schedule's rates (method §7.6).
class Optimiser {
 public:
  // Zero moments in the shapes of the scene.
  explicit Optimiser(const Scene& scene);

  // One step on whatever is trainable, of positions at that share of their rate. Entries that are not finite
  // are left alone. Where memory runs out, nothing has changed.
  void step(Scene& scene, const SceneGradient& gradient, const Trainable& trainable, const Schedule& schedule,
            const RateOptions& rates, int iteration, double share_of_positions = 1);
  // What the last step left alone. Waits for the device.
  NonFiniteGradients left_alone() const { return notes_.report(); }

  // Of parameters that the scene has got since.
  void begin(const Motion& motion);
  void begin(const Nodes& nodes);
  void begin(const Lighting& lighting);

  SurfelMoments& main() { return main_; }
  SurfelMoments& environment() { return environment_; }

  void put(Safetensors& file) const;
  // Throws InputError where the file's moments do not fit the scene that this optimiser was made for.
  void get(const Safetensors& file);

 private:
  // f(name, state) for all.
  template <class Self, class F>
  static void for_each(Self& self, F&& f);

  SurfelMoments main_, environment_;
  std::vector<optimize::AdamState> main_motion_, main_nodes_, lighting_;
  std::vector<optimize::AdamState> main_field_, environment_field_, map_field_;
  optimize::AdamState map_;
  StepNotes notes_;
};

}  // namespace traceflow
