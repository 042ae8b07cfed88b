#include "train/optimiser.h"

#include <algorithm>

namespace traceflow {

namespace {

optimize::AdamState zero_state(const Tensor<float>& parameter) {
  return {Tensor<float>(parameter.shape(), parameter.device()),
          Tensor<float>(parameter.shape(), parameter.device()), 0};
}

// Relative to the rate of poses, which are already solved when nodes start.
constexpr double node_rates = 4;
// Relative to the rate of the grid's brightness. A view determines the four numbers of a body at two times
// only; at the full rate each step would change them by 4 %.
constexpr double body_brightness_rates = 0.1;

// For a field, motion, nodes or lighting.
template <class Parameters>
std::vector<optimize::AdamState> zero_states(const Parameters& parameters) {
  std::vector<optimize::AdamState> states;
  parameters.for_each(
      [&](const std::string&, const Tensor<float>& tensor) { states.push_back(zero_state(tensor)); });
  return states;
}

// Collects the tensors of a step, so that all are updated in one call.
class Stepper {
 public:
  explicit Stepper(StepNotes& notes) : notes_(notes) { notes_.tensors.clear(); }

  void operator()(const std::string& name, Tensor<float>& parameter, const Tensor<float>& gradient,
                  optimize::AdamState& state, double rate) {
    (*this)(name, parameter, gradient, state, std::vector<float>{static_cast<float>(rate)});
  }
  // With one rate per column.
  void operator()(const std::string& name, Tensor<float>& parameter, const Tensor<float>& gradient,
                  optimize::AdamState& state, const std::vector<float>& rates) {
    tasks_.push_back({&parameter, &gradient, &state, rates});
    notes_.tensors.push_back({name, parameter.row_size()});
  }
  void finish(const optimize::AdamOptions& options) {
    optimize::adam_step(tasks_, options, notes_.left_alone);
  }

 private:
  std::vector<optimize::AdamTask> tasks_;
  StepNotes& notes_;
};

void step_surfels(Stepper& step, const std::string& set, Surfels& surfels, const Surfels& gradient,
                  SurfelMoments& moments, double position_rate, const RateOptions& rates) {
  step(set + ".position", surfels.position, gradient.position, moments.position, position_rate);
  step(set + ".log_scale", surfels.log_scale, gradient.log_scale, moments.log_scale, rates.log_scale);
  step(set + ".rotation", surfels.rotation, gradient.rotation, moments.rotation, rates.rotation);
  step(set + ".opacity_logit", surfels.opacity_logit, gradient.opacity_logit, moments.opacity_logit,
       rates.opacity);
  std::vector<float> sh_rates(static_cast<size_t>(surfels.sh.row_size()), rates.sh / rates.sh_rest_divisor);
  std::fill_n(sh_rates.begin(), std::min<size_t>(3, sh_rates.size()), rates.sh);
  step(set + ".sh", surfels.sh, gradient.sh, moments.sh, sh_rates);
}

void step_field(Stepper& step, const std::string& name, Field& field, const Field& gradient,
                std::vector<optimize::AdamState>& states, double rate) {
  std::vector<const Tensor<float>*> gradients;
  gradient.for_each([&](const std::string&, const Tensor<float>& tensor) { gradients.push_back(&tensor); });
  size_t k = 0;
  field.for_each([&](const std::string& tensor_name, Tensor<float>& tensor) {
    step(name + "." + tensor_name, tensor, *gradients[k], states[k], rate);
    ++k;
  });
}

}  // namespace

NonFiniteGradients StepNotes::report() const {
  NonFiniteGradients report;
  Tensor<optimize::LeftAlone> fetched;
  const Tensor<optimize::LeftAlone>& notes = on_host(left_alone, fetched);
  for (size_t k = 0; k < tensors.size(); ++k) {
    const optimize::LeftAlone& note = notes[static_cast<int64_t>(k)];
    if (note.count > 0 && report.count == 0) {
      const int64_t row = tensors[k].row_size > 0 ? note.first() / tensors[k].row_size : 0;
      report.first = tensors[k].name + ", row " + std::to_string(row);
    }
    report.count += note.count;
  }
  return report;
}

void SurfelMoments::reset_like(const Surfels& surfels) {
  for_each_field([](const SurfelField&, optimize::AdamState& state,
                    const Tensor<float>& field) { state = zero_state(field); },
                 *this, surfels);
}

SurfelMoments SurfelMoments::edited(const PlacedEdit& edit) const {
  const auto state = [&](const optimize::AdamState& from) -> optimize::AdamState {
    if (from.first.empty()) return {};
    return {edited_rows(from.first, edit, true), edited_rows(from.second, edit, true), from.step};
  };
  SurfelMoments result;
  for_each_field(
      [&](const SurfelField&, const optimize::AdamState& from, optimize::AdamState& to) { to = state(from); },
      *this, result);
  return result;
}

Optimiser::Optimiser(const Scene& scene) {
  main_.reset_like(scene.main);
  environment_.reset_like(scene.environment);
  if (scene.main_field) main_field_ = zero_states(*scene.main_field);
  if (scene.main_motion) main_motion_ = zero_states(*scene.main_motion);
  if (scene.main_nodes) begin(*scene.main_nodes);
  if (scene.lighting) begin(*scene.lighting);
  if (scene.environment_field) environment_field_ = zero_states(*scene.environment_field);
  if (scene.environment_map) {
    map_ = zero_state(scene.environment_map->logit);
    if (scene.environment_map->field) map_field_ = zero_states(*scene.environment_map->field);
  }
}

void Optimiser::begin(const Motion& motion) { main_motion_ = zero_states(motion); }
void Optimiser::begin(const Nodes& nodes) { main_nodes_ = zero_states(nodes); }
void Optimiser::begin(const Lighting& lighting) { lighting_ = zero_states(lighting); }

void Optimiser::step(Scene& scene, const SceneGradient& gradient, const Trainable& trainable,
                     const Schedule& schedule, const RateOptions& rates, int iteration,
                     double share_of_positions) {
  Stepper step(notes_);
  const double position_rate = share_of_positions * schedule.position_rate(iteration) * scene.extent;
  const double field_rate = schedule.field_rate(iteration);

  if (trainable.main) step_surfels(step, "main", scene.main, gradient.main, main_, position_rate, rates);
  if (trainable.tint && scene.main.has_tint()) {
    step("main.tint_logit", scene.main.tint_logit, gradient.main.tint_logit, main_.tint_logit, rates.tint);
  }
  if (trainable.tint && scene.main.has_roughness()) {
    step("main.roughness_logit", scene.main.roughness_logit, gradient.main.roughness_logit,
         main_.roughness_logit, rates.roughness);
  }
  if (trainable.main_field && scene.main_field) {
    step_field(step, "main_field", *scene.main_field, gradient.main_field, main_field_, field_rate);
  }
  if (trainable.main_motion && scene.main_motion) {
    Motion& motion = *scene.main_motion;
    const double rate = schedule.motion_rate(iteration);
    step("main_motion.rotation", motion.rotation, gradient.main_motion.rotation, main_motion_[0], rate / 2);
    step("main_motion.shift", motion.shift, gradient.main_motion.shift, main_motion_[1], rate * scene.extent);
  }
  if (trainable.main_nodes && scene.main_nodes) {
    Nodes& nodes = *scene.main_nodes;
    const double rate = node_rates * schedule.motion_rate(iteration);
    step("main_nodes.turn", nodes.turn, gradient.main_nodes.turn, main_nodes_[0], rate);
    step("main_nodes.shift", nodes.shift, gradient.main_nodes.shift, main_nodes_[1], rate * scene.extent);
  }
  if (trainable.lighting && scene.lighting) {
    step("lighting.brightness", scene.lighting->brightness, gradient.lighting.brightness, lighting_[0],
         rates.lighting);
    if (scene.lighting->bodies() > 0) {
      step("lighting.body_brightness", scene.lighting->body_brightness, gradient.lighting.body_brightness,
           lighting_[1], body_brightness_rates * rates.lighting);
    }
  }
  if (trainable.environment && scene.environment.count() > 0) {
    step_surfels(step, "environment", scene.environment, gradient.environment, environment_, position_rate,
                 rates);
  }
  if (trainable.environment_field && scene.environment_field) {
    step_field(step, "environment_field", *scene.environment_field, gradient.environment_field,
               environment_field_, field_rate);
  }
  if (trainable.environment && scene.environment_map) {
    EnvironmentMap& map = *scene.environment_map;
    step("environment_map.logit", map.logit, gradient.environment_map.logit, map_,
         schedule.map_rate(iteration));
    if (trainable.environment_field && map.field) {
      step_field(step, "environment_map.field", *map.field, *gradient.environment_map.field, map_field_,
                 field_rate);
    }
  }
  step.finish(rates.adam());
}

template <class Self, class F>
void Optimiser::for_each(Self& self, F&& f) {
  const auto surfels = [&](const std::string& set, auto& moments) {
    moments.for_each([&](const std::string& name, auto& state) { f("adam/" + set + "/" + name, state); });
  };
  const auto fields = [&](const std::string& name, auto& states) {
    for (size_t k = 0; k < states.size(); ++k) f("adam/" + name + "/" + std::to_string(k), states[k]);
  };
  surfels("main", self.main_);
  surfels("environment", self.environment_);
  fields("main_motion", self.main_motion_);
  fields("main_nodes", self.main_nodes_);
  fields("lighting", self.lighting_);
  fields("main_field", self.main_field_);
  fields("environment_field", self.environment_field_);
  fields("map_field", self.map_field_);
  f(std::string("adam/map"), self.map_);
}

void Optimiser::put(Safetensors& file) const {
  // for_each itself changes nothing; only its function could.
  for_each(const_cast<Optimiser&>(*this), [&](const std::string& name, const optimize::AdamState& state) {
    if (state.first.empty()) return;
    file.add(name + "/first", state.first);
    file.add(name + "/second", state.second);
    Tensor<int64_t> step(Shape{1});
    step[0] = state.step;
    file.add(name + "/step", step);
  });
}

void Optimiser::get(const Safetensors& file) {
  const auto read = [&](const std::string& name, Tensor<float>& into) {
    Tensor<float> stored = file.tensor<float>(name);
    if (stored.shape() != into.shape()) {
      throw InputError("checkpoint", name, "shape " + stored.shape().to_string(), into.shape().to_string());
    }
    into = stored.on(into.device());
  };
  for_each(*this, [&](const std::string& name, optimize::AdamState& state) {
    if (state.first.empty()) return;
    read(name + "/first", state.first);
    read(name + "/second", state.second);
    const Tensor<int64_t> step = file.tensor<int64_t>(name + "/step");
    if (step.size() != 1)
      throw InputError("checkpoint", name + "/step", step.shape().to_string(), "one number");
    state.step = step[0];
  });
}

}  // namespace traceflow
