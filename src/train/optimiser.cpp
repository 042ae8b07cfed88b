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

void step_surfels(PreparedStep& step, const std::string& set, Surfels& surfels, const Surfels& gradient,
                  SurfelMoments& moments, double position_rate, const RateOptions& rates) {
  step.add(set + ".position", surfels.position, gradient.position, moments.position, position_rate);
  step.add(set + ".log_scale", surfels.log_scale, gradient.log_scale, moments.log_scale, rates.log_scale);
  step.add(set + ".rotation", surfels.rotation, gradient.rotation, moments.rotation, rates.rotation);
  step.add(set + ".opacity_logit", surfels.opacity_logit, gradient.opacity_logit, moments.opacity_logit,
           rates.opacity);
  std::vector<float> sh_rates(static_cast<size_t>(surfels.sh.row_size()), rates.sh / rates.sh_rest_divisor);
  std::fill_n(sh_rates.begin(), std::min<size_t>(3, sh_rates.size()), rates.sh);
  step.add(set + ".sh", surfels.sh, gradient.sh, moments.sh, sh_rates);
}

// For a field, motion, nodes or lighting. rates: one for all tensors, or one for each.
template <class Parameters>
void step_each(PreparedStep& step, const std::string& name, Parameters& parameters,
               const Parameters& gradient, std::vector<optimize::AdamState>& states,
               const std::vector<double>& rates) {
  std::vector<const Tensor<float>*> gradients;
  gradient.for_each([&](const std::string&, const Tensor<float>& tensor) { gradients.push_back(&tensor); });
  size_t k = 0;
  parameters.for_each([&](const std::string& tensor_name, Tensor<float>& tensor) {
    const double rate = rates[std::min(k, rates.size() - 1)];
    if (!tensor.empty()) step.add(name + "." + tensor_name, tensor, *gradients[k], states[k], rate);
    ++k;
  });
}

}  // namespace

void PreparedStep::add(const std::string& name, Tensor<float>& parameter, const Tensor<float>& gradient,
                       optimize::AdamState& state, std::vector<float> rates) {
  parts.push_back({name, parameter.row_size()});
  tasks.push_back({&parameter, &gradient, &state, std::move(rates)});
}

NonFiniteGradients PreparedStep::report() const {
  NonFiniteGradients report;
  Tensor<optimize::LeftAlone> fetched;
  const Tensor<optimize::LeftAlone>& skipped = on_host(left_alone, fetched);
  for (size_t k = 0; k < parts.size(); ++k) {
    const optimize::LeftAlone& entries = skipped[static_cast<int64_t>(k)];
    if (entries.count > 0 && report.count == 0) {
      const int64_t row = parts[k].row_size > 0 ? entries.first() / parts[k].row_size : 0;
      report.first = parts[k].name + ", row " + std::to_string(row);
    }
    report.count += entries.count;
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

void Optimiser::prepare(Scene& scene, const SceneGradient& gradient, const Trainable& trainable,
                        const Schedule& schedule, const RateOptions& rates, int iteration,
                        double share_of_positions) {
  PreparedStep& step = step_;
  step.parts.clear();
  step.tasks.clear();
  const double position_rate = share_of_positions * schedule.position_rate(iteration) * scene.extent;
  const double field_rate = schedule.field_rate(iteration);

  if (trainable.main) step_surfels(step, "main", scene.main, gradient.main, main_, position_rate, rates);
  if (trainable.tint && scene.main.has_tint()) {
    step.add("main.tint_logit", scene.main.tint_logit, gradient.main.tint_logit, main_.tint_logit,
             rates.tint);
  }
  if (trainable.tint && scene.main.has_roughness()) {
    step.add("main.roughness_logit", scene.main.roughness_logit, gradient.main.roughness_logit,
             main_.roughness_logit, rates.roughness);
  }
  if (trainable.main_field && scene.main_field)
    step_each(step, "main_field", *scene.main_field, gradient.main_field, main_field_, {field_rate});
  const double motion_rate = schedule.motion_rate(iteration);
  if (trainable.main_motion && scene.main_motion) {
    step_each(step, "main_motion", *scene.main_motion, gradient.main_motion, main_motion_,
              {motion_rate / 2, motion_rate * scene.extent});
  }
  if (trainable.main_nodes && scene.main_nodes) {
    const double rate = node_rates * motion_rate;
    step_each(step, "main_nodes", *scene.main_nodes, gradient.main_nodes, main_nodes_,
              {rate, rate * scene.extent});
  }
  if (trainable.lighting && scene.lighting) {
    step_each(step, "lighting", *scene.lighting, gradient.lighting, lighting_,
              {rates.lighting, body_brightness_rates * rates.lighting});
  }
  if (trainable.environment && scene.environment.count() > 0) {
    step_surfels(step, "environment", scene.environment, gradient.environment, environment_, position_rate,
                 rates);
  }
  if (trainable.environment_field && scene.environment_field) {
    step_each(step, "environment_field", *scene.environment_field, gradient.environment_field,
              environment_field_, {field_rate});
  }
  if (trainable.environment && scene.environment_map) {
    EnvironmentMap& map = *scene.environment_map;
    step.add("environment_map.logit", map.logit, gradient.environment_map.logit, map_,
             schedule.map_rate(iteration));
    if (trainable.environment_field && map.field) {
      step_each(step, "environment_map.field", *map.field, *gradient.environment_map.field, map_field_,
                {field_rate});
    }
  }
  step.left_alone.place(scene.device()).reset({static_cast<int64_t>(step.tasks.size())});
  step.options = rates.adam();
}

void Optimiser::step() { optimize::adam_step(step_.tasks, step_.options, step_.left_alone); }

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
