#include "train/camera_refinement.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "math/rotation_group.h"

namespace traceflow {

namespace {

Mat3<double> rotation_of(const Vec3<double>& turn) { return rotation_from_quaternion(quaternion_exp(turn)); }

Vec3<double> composed(const Vec3<double>& second, const Vec3<double>& first) {
  return quaternion_log(unit_quaternion(quaternion_product(quaternion_exp(second), quaternion_exp(first))));
}

Tensor<double> rows_in(const Safetensors& file, const std::string& name) {
  Tensor<double> rows = file.tensor<double>(name);
  const bool is_finite = std::all_of(rows.values().begin(), rows.values().end(),
                                     [](double value) { return std::isfinite(value); });
  if (rows.shape() != Shape{rows.shape()[0], 3} || !is_finite)
    throw InputError("checkpoint", name, rows.shape().to_string(), "finite numbers, three for each view");
  return rows;
}

}  // namespace

std::array<double, 6> pose_gradient(const Camera<float>& camera, const CameraGradient<float>& gradient) {
  // camera_from_world · exp(−turn), to first order camera_from_world · (1 − [turn]ₓ).
  const Mat3<double> a =
      transpose(Mat3<double>(camera.camera_from_world)) * Mat3<double>(gradient.camera_from_world);
  const Vec3<double> shift(gradient.position);
  return {a[2][1] - a[1][2], a[0][2] - a[2][0], a[1][0] - a[0][1], shift.x, shift.y, shift.z};
}

Camera<float> moved(const Camera<float>& camera, const Vec3<double>& turn, const Vec3<double>& shift) {
  Camera<float> result = camera;
  result.camera_from_world = Mat3<float>(Mat3<double>(camera.camera_from_world) * rotation_of(-turn));
  result.position = Vec3<float>(Vec3<double>(camera.position) + shift);
  return result;
}

Camera<float> CameraCorrections::applied(const Camera<float>& given, int64_t view) const {
  if (empty()) return given;
  if (view >= turn.shape()[0]) {
    throw InputError("checkpoint", "cameras/turn", std::to_string(turn.shape()[0]) + " views",
                     "more than " + std::to_string(view));
  }
  return moved(given, load3<double>(turn.row(view)), load3<double>(shift.row(view)));
}

CameraCorrections corrections_in(const Safetensors& checkpoint) {
  if (!checkpoint.has("cameras/turn")) return {};
  CameraCorrections found{rows_in(checkpoint, "cameras/turn"), rows_in(checkpoint, "cameras/shift")};
  if (found.turn.shape() != found.shift.shape()) {
    throw InputError("checkpoint", "cameras/shift", found.shift.shape().to_string(),
                     found.turn.shape().to_string() + ", as cameras/turn has");
  }
  return found;
}

void CameraSteps::step(const std::array<double, 6>& gradient, double rate, double length,
                       const optimize::AdamOptions& adam, Vec3<double>& turn, Vec3<double>& shift) {
  const auto angle = static_cast<float>(rate), way = static_cast<float>(rate * length);
  const std::array<float, 6> rates = {angle, angle, angle, way, way, way};
  Tensor<float> change({1, 6}), by(Shape{1, 6});
  change.fill(0);
  for (int64_t i = 0; i < 6; ++i) by[i] = static_cast<float>(gradient[static_cast<size_t>(i)]);
  if (moments.first.empty()) {
    moments.first.reset(change.shape());
    moments.second.reset(change.shape());
  }
  optimize::adam_step(change, by, moments, rates, adam);
  turn = composed({change[0], change[1], change[2]}, turn);
  shift += Vec3<double>(change[3], change[4], change[5]);
}

CameraRefinement::CameraRefinement(const std::vector<View>& given) : steps_(given.size()) {
  for (const View& view : given) given_.push_back(view.camera);
  const Shape shape{static_cast<int64_t>(given.size()), 3};
  corrections_.turn.reset(shape);
  corrections_.shift.reset(shape);
}

Camera<float> CameraRefinement::camera(int64_t view) const {
  return corrections_.applied(given_[static_cast<size_t>(view)], view);
}

void CameraRefinement::step(int64_t view, const CameraGradient<float>& gradient, double rate, double length,
                            const optimize::AdamOptions& adam) {
  Vec3<double> turn = load3<double>(corrections_.turn.row(view));
  Vec3<double> shift = load3<double>(corrections_.shift.row(view));
  CameraSteps steps = steps_[static_cast<size_t>(view)];
  steps.step(pose_gradient(camera(view), gradient), rate, length, adam, turn, shift);
  // Nothing has changed so far, and nothing below allocates memory.
  begun_ = true;
  steps_[static_cast<size_t>(view)] = std::move(steps);
  store3(corrections_.turn.row(view), turn);
  store3(corrections_.shift.row(view), shift);
  leave_out_similarity();
}

// Least squares of shift_i = t + ω × r_i + s r_i and turn_i = ω, with r_i relative to the mean of the centres
// and lengths in units of their root mean square. Σ r_i = 0 decouples the unknowns.
void CameraRefinement::leave_out_similarity() {
  const auto count = static_cast<double>(given_.size());
  Vec3<double> centroid(0);
  for (const Camera<float>& camera : given_) centroid += Vec3<double>(camera.position) / count;
  double spread = 0, along = 0;
  Vec3<double> mean_shift(0), moment(0), turns(0);
  Mat3<double> inertia(0);
  for (size_t i = 0; i < given_.size(); ++i) {
    const auto row = static_cast<int64_t>(i);
    const Vec3<double> r = Vec3<double>(given_[i].position) - centroid;
    const Vec3<double> shift = load3<double>(corrections_.shift.row(row));
    spread += dot(r, r);
    along += dot(r, shift);
    mean_shift += shift / count;
    moment += cross(r, shift);
    turns += load3<double>(corrections_.turn.row(row));
    inertia += Mat3<double>(dot(r, r)) - outerProduct(r, r);
  }
  // Centres that coincide do not determine a scale or a common rotation.
  const double per_length2 = spread > 0 ? count / spread : 0;
  const double growth = spread > 0 ? along / spread : 0;
  const Vec3<double> turn =
      inverse(inertia * per_length2 + Mat3<double>(count)) * (moment * per_length2 + turns);
  for (size_t i = 0; i < given_.size(); ++i) {
    const auto row = static_cast<int64_t>(i);
    const Vec3<double> r = Vec3<double>(given_[i].position) - centroid;
    const Vec3<double> shared = mean_shift + cross(turn, r) + growth * r;
    store3(corrections_.shift.row(row), load3<double>(corrections_.shift.row(row)) - shared);
    store3(corrections_.turn.row(row), composed(-turn, load3<double>(corrections_.turn.row(row))));
  }
}

void CameraRefinement::put(Safetensors& checkpoint) const {
  if (!begun_) return;
  const Shape shape{static_cast<int64_t>(steps_.size()), 6};
  Tensor<float> first(shape), second(shape);
  first.fill(0);
  second.fill(0);
  Tensor<int64_t> count(Shape{shape[0]});
  for (int64_t view = 0; view < shape[0]; ++view) {
    const optimize::AdamState& moments = steps_[static_cast<size_t>(view)].moments;
    count[view] = moments.step;
    if (moments.first.empty()) continue;
    std::copy_n(moments.first.data(), 6, first.row(view));
    std::copy_n(moments.second.data(), 6, second.row(view));
  }
  checkpoint.add("cameras/turn", corrections_.turn);
  checkpoint.add("cameras/shift", corrections_.shift);
  checkpoint.add("cameras/moments/first", first);
  checkpoint.add("cameras/moments/second", second);
  checkpoint.add("cameras/moments/step", count);
}

void CameraRefinement::get(const Safetensors& checkpoint) {
  const auto views = static_cast<int64_t>(given_.size());
  CameraCorrections corrections = corrections_in(checkpoint);
  if (corrections.empty()) return;
  if (corrections.turn.shape() != corrections_.turn.shape()) {
    throw InputError("checkpoint", "cameras/turn", corrections.turn.shape().to_string(),
                     corrections_.turn.shape().to_string());
  }
  const Tensor<float> first = checkpoint.tensor<float>("cameras/moments/first");
  const Tensor<float> second = checkpoint.tensor<float>("cameras/moments/second");
  const Tensor<int64_t> count = checkpoint.tensor<int64_t>("cameras/moments/step");
  const Shape shape{views, 6};
  if (first.shape() != shape || second.shape() != shape || count.shape() != Shape{views}) {
    throw InputError("checkpoint", "cameras/moments", first.shape().to_string(), shape.to_string());
  }
  corrections_ = std::move(corrections);
  begun_ = true;
  for (int64_t view = 0; view < views; ++view) {
    optimize::AdamState& moments = steps_[static_cast<size_t>(view)].moments;
    moments = {};
    if (count[view] == 0) continue;
    moments.step = count[view];
    moments.first.reset({1, 6});
    moments.second.reset({1, 6});
    std::copy_n(first.row(view), 6, moments.first.data());
    std::copy_n(second.row(view), 6, moments.second.data());
  }
}

}  // namespace traceflow
