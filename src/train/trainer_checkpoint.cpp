#include <fmt/format.h>

#include <array>
#include <bit>
#include <cmath>

#include "files/options_json.h"
#include "scene/scene_file.h"
#include "train/continuation.h"
#include "train/trainer.h"

// The content of a checkpoint, and how a run continues from it.
namespace traceflow {

namespace {

template <size_t count>
Tensor<double> row_of(const std::array<double, count>& values) {
  Tensor<double> row(Shape{static_cast<int64_t>(count)});
  std::copy(values.begin(), values.end(), row.data());
  return row;
}

// A count stored in the checkpoint's metadata.
int64_t count_in(const Safetensors& file, const std::string& key) {
  const double value = file.number(key);
  if (value > 1e9 || value != std::floor(value)) {
    throw InputError("checkpoint", key, file.text(key), "a whole number up to 1e9");
  }
  return static_cast<int64_t>(value);
}

Tensor<double> rows_of(const Mat3<double>& matrix) {
  Tensor<double> rows({3, 3});
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) rows(r, c) = matrix[c][r];
  }
  return rows;
}

Mat3<double> rotation_in(const Tensor<double>& rows) {
  constexpr double rounding = 1e-6;
  Mat3<double> matrix(0);
  bool is_rotation = rows.shape() == Shape{3, 3};
  if (is_rotation) {
    matrix = transpose(
        Mat3<double>(load3<double>(rows.row(0)), load3<double>(rows.row(1)), load3<double>(rows.row(2))));
    const Mat3<double> unit = transpose(matrix) * matrix;
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r < 3; ++r)
        is_rotation = is_rotation && std::abs(unit[c][r] - (c == r ? 1 : 0)) < rounding;
    }
    is_rotation = is_rotation && determinant(matrix) > 0;
  }
  if (!is_rotation)
    throw InputError("checkpoint", "prior_bias", rows.shape().to_string() + " that rotates nothing",
                     "a rotation, 3x3");
  return matrix;
}

// each: neighbours per surfel.
void check_neighbour_edges(const Neighbours& edges, int64_t surfels, int64_t each) {
  bool fits = edges.index.shape() == Shape{surfels, each} && edges.distance2.shape() == edges.index.shape();
  for (const int32_t j : edges.index.values()) fits = fits && j >= -1 && j < surfels;
  if (!fits) {
    throw InputError("checkpoint", "bonds", edges.index.shape().to_string(),
                     Shape{surfels, each}.to_string());
  }
}

}  // namespace

Safetensors Trainer::checkpoint() const {
  Safetensors file;
  put_scene(scene_, file);
  optimiser_.put(file);
  main_density_.put(file);
  environment_density_.put(file);
  if (!neighbour_edges_.index.empty()) {
    file.add("bonds/index", neighbour_edges_.index);
    file.add("bonds/distance2", neighbour_edges_.distance2);
  }
  if (!texture_trust_.turned.empty()) {
    file.add("texture_trust/turned", texture_trust_.turned);
    file.add("texture_trust/taken_back_by_colour", texture_trust_.taken_back_by_colour);
    file.add("texture_trust/taken_back_by_tracks", texture_trust_.taken_back_by_tracks);
    file.add("texture_trust/stiffness", texture_trust_.stiffness);
    file.add("texture_trust/mirror_image", texture_trust_.mirror_image);
  }
  if (prior_bias_) file.add("prior_bias", rows_of(*prior_bias_));
  file.add("views/order", views_.order());
  Tensor<int64_t> random(Shape{4});
  for (size_t i = 0; i < 4; ++i) random[static_cast<int64_t>(i)] = std::bit_cast<int64_t>(random_.state()[i]);
  file.add("random", random);
  const DivergenceMonitor::State monitor = divergence_.state();
  file.add("health", row_of<3>({monitor.smoothed, monitor.best, static_cast<double>(monitor.steps)}));
  file.metadata["iteration"] = std::to_string(iteration_);
  file.metadata["views_next"] = std::to_string(views_.next());
  file.metadata["options"] = options_to_json(options_);
  file.metadata["capture"] = capture_.name;
  file.metadata["capture_folder"] = capture_folder_;
  file.metadata["found_masks"] = std::to_string(capture_.found_masks);
  file.metadata["initial_main_count"] = std::to_string(initial_main_count_);
  file.metadata["bodies_stand"] = std::to_string(bodies_stand_ ? 1 : 0);
  file.metadata["environment_radius"] = fmt::format("{}", environment_radius_);
  put_views(views_checksum_, file);
  cameras_.put(file);
  put_caps(memory_.caps, file);
  put_arithmetic(device_, file);
  put_version(file);
  return file;
}

void Trainer::resume() {
  std::string note;
  const Safetensors file = read_checkpoint(run_, note);
  Scene scene = get_scene(file);
  check_views(file, scene.normalisation, capture_);
  const int64_t found_masks =
      file.metadata.contains("found_masks") ? count_in(file, "found_masks") : int64_t{0};
  if (found_masks != capture_.found_masks) {
    throw InputError(run_.masks().string(), "", std::to_string(capture_.found_masks) + " masks",
                     "the " + std::to_string(found_masks) + " that the run found",
                     "put them back, or begin again");
  }
  scene.move_to(device_);
  scene_ = std::move(scene);
  optimiser_ = Optimiser(scene_);
  optimiser_.get(file);
  main_density_ = DensityControl("main", options_.density, scene_.main.count(), device_);
  main_density_.get(file);
  environment_density_ =
      DensityControl("environment", options_.environment_density, scene_.environment.count(), device_);
  environment_density_.get(file);
  neighbour_edges_ = {};
  if (file.has("bonds/index")) {
    neighbour_edges_ = {file.tensor<int32_t>("bonds/index"), file.tensor<float>("bonds/distance2")};
    check_neighbour_edges(neighbour_edges_, scene_.main.count(), neighbours_each);
    neighbour_edges_ = neighbour_edges_.on(device_);
  }
  texture_trust_ = {};
  if (file.has("texture_trust/turned")) {
    TextureTrust& trust = texture_trust_;
    trust.turned = file.tensor<double>("texture_trust/turned");
    trust.taken_back_by_colour = file.tensor<double>("texture_trust/taken_back_by_colour");
    trust.taken_back_by_tracks = file.tensor<double>("texture_trust/taken_back_by_tracks");
    trust.stiffness = file.tensor<double>("texture_trust/stiffness");
    const Shape bodies{scene_.main_motion ? scene_.main_motion->bodies() : 0};
    // Checkpoints from before 26 November 2026 do not have it.
    trust.mirror_image = file.has("texture_trust/mirror_image")
                             ? file.tensor<double>("texture_trust/mirror_image")
                             : Tensor<double>({bodies[0], 2});
    if (trust.turned.shape() != bodies || trust.taken_back_by_colour.shape() != bodies ||
        trust.taken_back_by_tracks.shape() != bodies || trust.stiffness.shape() != Shape{bodies[0], 3} ||
        trust.mirror_image.shape() != Shape{bodies[0], 2})
      throw InputError("checkpoint", "texture_trust", texture_trust_.turned.shape().to_string(),
                       bodies.to_string());
  }
  // Checkpoints from before 28 November 2026 do not have it.
  if (file.has("prior_bias")) set_prior_bias(rotation_in(file.tensor<double>("prior_bias")));
  cameras_.get(file);
  if (cameras_.is_begun()) set_refined_cameras();
  views_.set_state(file.tensor<int32_t>("views/order"), count_in(file, "views_next"));
  const Tensor<int64_t> random = file.tensor<int64_t>("random");
  const Tensor<double> monitor = file.tensor<double>("health");
  if (random.size() != 4 || monitor.size() != 3) {
    throw InputError("checkpoint", "random", random.shape().to_string(), "4 words of state");
  }
  Random::State state{};
  for (size_t i = 0; i < 4; ++i) state[i] = std::bit_cast<uint64_t>(random[static_cast<int64_t>(i)]);
  random_.set_state(state);
  divergence_.set_state({monitor[0], monitor[1], static_cast<int64_t>(monitor[2])});
  iteration_ = static_cast<int>(count_in(file, "iteration"));
  seconds_ = file.number("train_seconds");
  initial_main_count_ = file.metadata.contains("initial_main_count")
                            ? static_cast<int64_t>(count_in(file, "initial_main_count"))
                            : scene_.main.count();
  const Tensor<int32_t> body = scene_.main.body.on(Device::cpu);
  carries_ = std::any_of(body.values().begin(), body.values().end(), [](int32_t b) { return b >= 0; });
  bodies_stand_ = file.metadata.contains("bodies_stand") && count_in(file, "bodies_stand") != 0;
  // The radius depends on the number of initial surfels, which depended on the memory at the start.
  const bool tells_radius = file.metadata.contains("environment_radius");
  environment_radius_ = tells_radius ? static_cast<float>(file.number("environment_radius")) : cloud_radius_;
  checkpoint_state_ = divergence_.sound() ? CheckpointState::sound : CheckpointState::unsound;
  keep_caps(file);
  for (const std::string& other : {other_arithmetic(file, device_), other_version(file)}) {
    if (!other.empty()) warn(other);
  }
  if (note.empty()) return;
  // Last, so that the files remain unchanged if resuming fails.
  warn(note);
  set_damaged_aside(run_);
}

// Keeps the caps from the start of the run, whatever memory is free now. Otherwise it would end with other
// bytes.
void Trainer::keep_caps(const Safetensors& file) {
  const std::optional<SurfelCaps> caps = caps_to_keep(file, options_);
  if (!caps) return;
  memory_ = with_caps(memory_, memory_setting(options_, device_, capture_), *caps);
  const int64_t available = available_bytes(device_);
  if (memory_.forecast_bytes <= available) return;
  const auto mebibytes = [](int64_t bytes) { return std::to_string(bytes >> 20) + " MiB"; };
  warn("the run may take " + mebibytes(memory_.forecast_bytes) + ", as when it began, and " +
       mebibytes(available) + " are free now; --memory-budget makes it smaller, and its end another");
}

}  // namespace traceflow
