#include "train/checkpoint.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "scene/scene_file.h"

namespace traceflow {

namespace {

// A count stored in the checkpoint's metadata. in_older: the count in older checkpoints that do not store it.
int64_t count_in(const Safetensors& file, const std::string& key, std::optional<int64_t> in_older = {}) {
  if (in_older && !file.metadata.contains(key)) return *in_older;
  const double value = file.number(key);
  if (value > 1e9 || value != std::floor(value)) {
    throw InputError("checkpoint", key, file.text(key), "a whole number up to 1e9");
  }
  return static_cast<int64_t>(value);
}

Tensor<double> rows_of(const Mat3<double>& matrix) {
  Tensor<double> rows({3, 3});
  for (int r = 0; r < 3; ++r) store3(rows.row(r), transpose(matrix)[r]);
  return rows;
}

Mat3<double> rotation_in(const Tensor<double>& rows) {
  constexpr double rounding = 1e-6;
  if (rows.shape() == Shape{3, 3}) {
    const Mat3<double> matrix = transpose(
        Mat3<double>(load3<double>(rows.row(0)), load3<double>(rows.row(1)), load3<double>(rows.row(2))));
    const Mat3<double> error = transpose(matrix) * matrix - Mat3<double>(1);
    const double largest = std::max({length(error[0]), length(error[1]), length(error[2])});
    if (largest < rounding && determinant(matrix) > 0) return matrix;
  }
  throw InputError("checkpoint", "prior_bias", rows.shape().to_string() + " that rotates nothing",
                   "a rotation, 3x3");
}

void put_neighbours(const Neighbours& neighbours, Safetensors& file) {
  if (neighbours.index.empty()) return;
  file.add("bonds/index", neighbours.index);
  file.add("bonds/distance2", neighbours.distance2);
}

Neighbours get_neighbours(const Safetensors& file, int64_t surfels) {
  if (!file.has("bonds/index")) return {};
  Neighbours read{file.tensor<int32_t>("bonds/index"), file.tensor<float>("bonds/distance2")};
  const Shape expected{surfels, neighbours_per_surfel};
  bool fits = read.index.shape() == expected && read.distance2.shape() == expected;
  for (const int32_t j : read.index.values()) fits = fits && j >= -1 && j < surfels;
  if (!fits) throw InputError("checkpoint", "bonds", read.index.shape().to_string(), expected.to_string());
  return read;
}

template <class Trust, class F>
void for_each_sum(Trust& trust, F&& f) {
  f("texture_trust/turned", trust.turned);
  f("texture_trust/taken_back_by_colour", trust.taken_back_by_colour);
  f("texture_trust/taken_back_by_tracks", trust.taken_back_by_tracks);
  f("texture_trust/stiffness", trust.stiffness);
  f("texture_trust/mirror_image", trust.mirror_image);
}

TextureTrust get_texture_trust(const Safetensors& file, int64_t bodies) {
  if (!file.has("texture_trust/turned")) return {};
  TextureTrust trust = TextureTrust::of(bodies);
  for_each_sum(trust, [&](const std::string& name, Tensor<double>& sum) {
    // Checkpoints from before 26 November 2026 do not have it.
    if (name == "texture_trust/mirror_image" && !file.has(name)) return;
    Tensor<double> stored = file.tensor<double>(name);
    if (stored.shape() != sum.shape()) {
      throw InputError("checkpoint", "texture_trust", stored.shape().to_string(), sum.shape().to_string());
    }
    sum = std::move(stored);
  });
  return trust;
}

void put_random(const Random& random, Safetensors& file) {
  Tensor<int64_t> words(Shape{4});
  for (size_t i = 0; i < 4; ++i) words[static_cast<int64_t>(i)] = std::bit_cast<int64_t>(random.state()[i]);
  file.add("random", words);
}

void get_random(const Safetensors& file, Random& random) {
  const Tensor<int64_t> words = file.tensor<int64_t>("random");
  if (words.size() != 4)
    throw InputError("checkpoint", "random", words.shape().to_string(), "4 words of state");
  Random::State state{};
  for (size_t i = 0; i < 4; ++i) state[i] = std::bit_cast<uint64_t>(words[static_cast<int64_t>(i)]);
  random.set_state(state);
}

void put_divergence(const DivergenceMonitor& divergence, Safetensors& file) {
  const DivergenceMonitor::State state = divergence.state();
  Tensor<double> numbers(Shape{3});
  numbers[0] = state.smoothed;
  numbers[1] = state.best;
  numbers[2] = static_cast<double>(state.steps);
  file.add("health", numbers);
}

void get_divergence(const Safetensors& file, DivergenceMonitor& divergence) {
  const Tensor<double> numbers = file.tensor<double>("health");
  if (numbers.size() != 3) throw InputError("checkpoint", "health", numbers.shape().to_string(), "3 numbers");
  divergence.set_state({numbers[0], numbers[1], static_cast<int64_t>(numbers[2])});
}

}  // namespace

void put_state(const TrainingState& state, Safetensors& file) {
  put_scene(state.scene, file);
  state.optimiser.put(file);
  state.main_density.put(file);
  state.environment_density.put(file);
  put_neighbours(state.neighbours, file);
  const TextureTrust& trust = state.bodies.texture_trust;
  if (!trust.turned.empty())
    for_each_sum(trust, [&](const char* name, const Tensor<double>& sum) { file.add(name, sum); });
  if (state.bodies.prior_bias) file.add("prior_bias", rows_of(*state.bodies.prior_bias));
  file.add("views/order", state.views.order());
  put_random(state.random, file);
  put_divergence(state.divergence, file);
  state.cameras.put(file);
  file.metadata["iteration"] = std::to_string(state.iteration);
  file.metadata["train_seconds"] = std::to_string(state.seconds);
  file.metadata["views_next"] = std::to_string(state.views.next());
  file.metadata["initial_main_count"] = std::to_string(state.initial_main_count);
  file.metadata["bodies_stand"] = std::to_string(state.bodies.at_rest ? 1 : 0);
  file.metadata["environment_radius"] = fmt::format("{}", state.environment_radius);
}

TrainingState get_state(const Safetensors& file, Scene scene, const TrainOptions& options,
                        const Capture& capture, float cloud_radius) {
  TrainingState state(options, capture, std::move(scene));
  const Surfels& main = state.scene.main;
  state.optimiser.get(file);
  state.main_density.get(file);
  state.environment_density.get(file);
  state.neighbours = get_neighbours(file, main.count()).on(main.device());
  const Tensor<int32_t> body = main.body.on(Device::cpu);
  BodyState& bodies = state.bodies;
  bodies.at_rest = count_in(file, "bodies_stand", 0) != 0;
  bodies.released =
      std::none_of(body.values().begin(), body.values().end(), [](int32_t b) { return b >= 0; });
  if (state.scene.main_motion)
    bodies.texture_trust = get_texture_trust(file, state.scene.main_motion->bodies());
  // Checkpoints from before 28 November 2026 do not have it.
  if (file.has("prior_bias")) bodies.prior_bias = rotation_in(file.tensor<double>("prior_bias"));
  state.views.set_state(file.tensor<int32_t>("views/order"), count_in(file, "views_next"));
  get_random(file, state.random);
  get_divergence(file, state.divergence);
  state.cameras.get(file);
  state.iteration = static_cast<int>(count_in(file, "iteration"));
  state.seconds = file.number("train_seconds");
  state.initial_main_count = count_in(file, "initial_main_count", main.count());
  // The radius depends on the number of initial surfels, which depended on the memory at the start.
  const bool has_radius = file.metadata.contains("environment_radius");
  state.environment_radius =
      has_radius ? static_cast<float>(file.number("environment_radius")) : cloud_radius;
  return state;
}

}  // namespace traceflow
