#include "viz/bake.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/random.h"
#include "files/png.h"
#include "math/activation.h"
#include "math/spherical_harmonics.h"
#include "ops/optimize/adam.h"

namespace traceflow::viz {

namespace {

constexpr int bake_degree = 3;
// Steps per camera from the surfels' own colours, and from the harmonics of a nearby time.
constexpr int64_t bake_passes = 6, bake_passes_again = 2;
constexpr double first_rate = 0.005, last_rate = 0.0005;
// Standard deviation of the moved cameras' offsets, in extents.
constexpr double camera_offset = 0.1;

// Half of the light of a mirror is unknown, so its colours begin as a mix with grey.
Tensor<float> first_harmonics(const Surfels& s) {
  const int64_t n = s.count(), k = sh_coefficients(bake_degree);
  Tensor<float> sh(Shape{n, k, 3});
  for (int64_t i = 0; i < n; ++i) {
    const float share = s.has_tint() ? 1 - sigmoid(s.tint_logit[i]) : 1.0F;
    std::transform(s.sh.row(i), s.sh.row(i) + s.sh.row_size(), sh.row(i), [=](float v) { return share * v; });
  }
  return sh;
}

class Baker {
 public:
  Baker(const Subject& subject, float time, const Surfels& posed)
      : subject_(subject), renderer_(subject.render) {
    const Device device = subject.scene.device();
    plain_.main = posed.on(device);
    plain_.main.tint_logit = plain_.main.roughness_logit = Tensor<float>();
    plain_.main.body = Tensor<int32_t>();
    plain_.specular = Specular::none;
    plain_.extent = subject.scene.extent;
    plain_.normalisation = subject.scene.normalisation;
    request_ = subject.request;
    request_.time = time;
    plain_request_ = request_;
    plain_request_.specular = false;
    plain_request_.sh_degree_main = bake_degree;
    trainable_ = {.tint = false,
                  .main_field = false,
                  .main_motion = false,
                  .main_nodes = false,
                  .lighting = false,
                  .environment = false,
                  .environment_field = false,
                  .camera = false};
  }

  // The image with reflections. The same renderer for all cameras: the pose and the tracer's BVH are reused.
  Tensor<uint8_t> with_reflections(const Camera<float>& camera) {
    request_.camera = camera;
    const Frame& frame = renderer_.forward(subject_.scene, request_);
    request_.reuse_pose = true;
    return to_8bit(frame.colour.on(Device::cpu));
  }

  double psnr(const Camera<float>& camera, const Tensor<uint8_t>& target) {
    return -10 * std::log10(std::max(squared_error(forward(camera, false), target), 1e-10));
  }

  void step(const Camera<float>& camera, const Tensor<uint8_t>& target, double rate) {
    Tensor<float> gradient = forward(camera, true);
    const float factor = 2 / static_cast<float>(gradient.size());
    for (int64_t i = 0; i < gradient.size(); ++i)
      gradient[i] = factor * (gradient[i] - static_cast<float>(target[i]) / 255);
    FrameGradient grad_frame;
    grad_frame.colour = gradient.on(plain_.device());
    gradient_.reset(plain_);
    plain_renderer().backward(plain_, plain_request_, trainable_, grad_frame, gradient_);
    optimize::adam_step(plain_.main.sh, gradient_.main.sh, moments_, static_cast<float>(rate), {});
  }

  void start_from(const Tensor<float>& harmonics) {
    const Device device = plain_.device();
    plain_.main.sh = harmonics.on(device);
    moments_.first = moments_.second = Tensor<float>(harmonics.shape(), device);
    // Poses of the surfels with other colours are not to be used again.
    plain_renderer_.reset();
  }
  Surfels surfels() const { return plain_.main.on(Device::cpu); }

 private:
  Renderer& plain_renderer() {
    if (!plain_renderer_) plain_renderer_.emplace(subject_.render);
    return *plain_renderer_;
  }
  Tensor<float> forward(const Camera<float>& camera, bool keep_for_backward) {
    plain_request_.camera = camera;
    return plain_renderer().forward(plain_, plain_request_, keep_for_backward).colour.on(Device::cpu);
  }
  static double squared_error(const Tensor<float>& image, const Tensor<uint8_t>& target) {
    double sum = 0;
    for (int64_t i = 0; i < image.size(); ++i) {
      const double d = std::clamp(image[i], 0.0F, 1.0F) - target[i] / 255.0;
      sum += d * d;
    }
    return sum / static_cast<double>(std::max<int64_t>(1, image.size()));
  }

  const Subject& subject_;
  Renderer renderer_;
  std::optional<Renderer> plain_renderer_;
  Scene plain_;  // the surfels without reflections
  FrameRequest request_, plain_request_;
  Trainable trainable_;
  SceneGradient gradient_;
  optimize::AdamState moments_;
};

std::vector<Camera<float>> with_moved(const std::vector<Camera<float>>& captured, float extent) {
  std::vector<Camera<float>> cameras = captured;
  Random random(1);
  for (const Camera<float>& camera : captured) {
    Camera<float> moved = camera;
    for (int axis = 0; axis < 3; ++axis)
      moved.position[axis] += static_cast<float>(camera_offset * extent * random.normal());
    cameras.push_back(moved);
  }
  return cameras;
}

}  // namespace

Baked bake(const Subject& subject, float time, const Surfels& posed,
           const std::vector<Camera<float>>& captured, const Tensor<float>* start,
           const std::function<bool(int64_t, int64_t)>& progress) {
  require(!captured.empty(), "there is a camera to bake for");
  Baker baker(subject, time, posed);
  const std::vector<Camera<float>> cameras = with_moved(captured, subject.scene.extent);
  const auto count = static_cast<int64_t>(cameras.size());
  const bool starts_near = start != nullptr && start->dim(0) == posed.count();
  const int64_t steps = count * (starts_near ? bake_passes_again : bake_passes);
  const int64_t all = count + steps;
  std::vector<Tensor<uint8_t>> targets;
  for (const Camera<float>& camera : cameras) {
    targets.push_back(baker.with_reflections(camera));
    if (!progress(static_cast<int64_t>(targets.size()), all)) return {posed};
  }
  const auto mean_psnr = [&] {
    double sum = 0;
    for (size_t i = 0; i < captured.size(); ++i) sum += baker.psnr(captured[i], targets[i]);
    return sum / static_cast<double>(captured.size());
  };
  Baked baked;
  baked.psnr_without = mean_psnr();
  baker.start_from(starts_near ? *start : first_harmonics(posed));

  Random random(2);
  std::vector<size_t> order(cameras.size());
  std::iota(order.begin(), order.end(), size_t{0});
  for (int64_t step = 0; step < steps; ++step) {
    const auto i = static_cast<size_t>(step % count);
    if (i == 0) {
      for (size_t k = order.size() - 1; k > 0; --k)
        std::swap(order[k], order[static_cast<size_t>(random.below(static_cast<int64_t>(k) + 1))]);
    }
    baker.step(cameras[order[i]], targets[order[i]],
               optimize::log_linear(first_rate, last_rate, step, steps));
    if (!progress(count + step + 1, all)) break;
  }
  baked.psnr = mean_psnr();
  baked.main = baker.surfels();
  return baked;
}

}  // namespace traceflow::viz
