#include "train/still_scene.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "math/spherical_harmonics.h"
#include "scene/neighbours.h"
#include "train/box_mean.h"
#include "train/initialise.h"
#include "train/trainer.h"

namespace traceflow {

namespace {

// Differences in [0, 1]. A pixel that differs by more has no gradient; a photograph that differs by less
// agrees.
constexpr float teaches_below = 0.06F, agrees_below = 0.045F;
// Surfels are tested this many times, over the last three fifths of training.
constexpr int tests = 6;
constexpr double first_test = 0.4;
constexpr double least_share = 0.5;
constexpr float most_agree = 0.6F;
constexpr int least_shown = 3;
constexpr float behind = 1.04F;

FrameRequest request_of(const View& view, const Scene& scene) {
  FrameRequest request;
  request.camera = view.camera;
  request.time = view.time;
  request.sh_degree_main = sh_degree(scene.main.sh.dim(1));
  request.deform_main = request.specular = false;
  return request;
}

// For each surfel, how many photographs show it, and how many of them agree with it.
struct Votes {
  std::vector<int32_t> shown, agree;

  double share(size_t i) const {
    return shown[i] == 0 ? 0 : static_cast<double>(agree[i]) / static_cast<double>(shown[i]);
  }
};

Votes vote(const Scene& scene, const Capture& capture, const RenderOptions& options) {
  const Surfels& main = scene.main;
  const auto count = static_cast<size_t>(main.count());
  Votes votes{std::vector<int32_t>(count), std::vector<int32_t>(count)};
  Renderer renderer(options);
  for (const View& view : capture.train) {
    const Frame& frame = renderer.forward(scene, request_of(view, scene), false);
    const Tensor<float> off = mean_difference(frame.colour, load_images(capture, view)->colour);
    parallel_for("still scene: vote", main.count(), [&](int64_t i) {
      const Vec3<float> point = load3<float>(main.position.row(i));
      if (!view.camera.sees(point)) return;
      const Vec3<float> in_camera = view.camera.point_in_camera(point);
      const Vec2<float> at = view.camera.project(in_camera);
      const auto row = static_cast<int64_t>(at.y), column = static_cast<int64_t>(at.x);
      if (in_camera.z * frame.raster.alpha(row, column) > behind * frame.raster.depth(row, column)) return;
      ++votes.shown[static_cast<size_t>(i)];
      votes.agree[static_cast<size_t>(i)] += off(row, column) < agrees_below ? 1 : 0;
    });
  }
  return votes;
}

// The object and what it hides in a photograph have no gradient. A hole may still be filled.
void leave_what_differs(const Frame& frame, const ViewImages& target, FrameGradient& gradient) {
  constexpr float whole = 0.9F;
  const Tensor<float> off = mean_difference(frame.colour, target.colour);
  for (int64_t i = 0; i < off.size(); ++i) {
    if (off[i] < teaches_below || frame.raster.alpha[i] < whole) continue;
    for (int64_t k = 3 * i; k < 3 * i + 3; ++k) gradient.colour[k] = 0;
  }
}

// One sample per pixel throughout, because a scene trained with one looks thin with several.
RenderOptions drawn_by(const TrainOptions& options) {
  RenderOptions render = options.render;
  render.samples = 1;
  return render;
}

TrainOptions still(const TrainOptions& options, int iterations) {
  TrainOptions o = preset("cpu");
  o.seed = options.seed;
  o.capture = options.capture;
  o.render = drawn_by(options);
  o.iterations = iterations;
  o.specular = Specular::none;
  o.deform.main = o.deform.environment = false;
  o.density.longest_unseen = 0;  // only the training views look at it
  o.loss.normal = o.loss.normal_prior = o.loss.rigidity = 0;
  return o;
}

}  // namespace

Tensor<float> mean_difference(const Tensor<float>& a, const Tensor<float>& b) {
  constexpr int64_t half_window = 2;  // pixels to each side
  Tensor<float> signed_difference(a.shape());
  for (int64_t i = 0; i < a.size(); ++i) signed_difference[i] = a[i] - b[i];
  const Tensor<float> mean = box_mean(signed_difference, half_window);
  Tensor<float> off({a.dim(0), a.dim(1)});
  for (int64_t i = 0; i < off.size(); ++i)
    off[i] = std::max({std::abs(mean[3 * i]), std::abs(mean[3 * i + 1]), std::abs(mean[3 * i + 2])});
  return off;
}

StillScene::StillScene(const Capture& capture, const TrainOptions& options, int iterations,
                       const StepsDone& told)
    : renderer_(drawn_by(options)), agreement_renderer_(drawn_by(options)) {
  Trainer trainer(still(options, iterations), capture, {});
  const int first = static_cast<int>(first_test * iterations);
  const int every = std::max(1, (iterations - first) / tests);
  for (int k = 0; k < iterations; ++k) {
    if (!told(k, iterations)) return;
    if (k == first) trainer.review_gradients(leave_what_differs);
    if (k >= first && (k - first) % every == 0) {
      const Votes votes = vote(trainer.scene(), capture, trainer.options().render);
      std::vector<int64_t> moving;
      for (size_t i = 0; i < votes.shown.size(); ++i) {
        if (votes.shown[i] >= least_shown && votes.share(i) < least_share)
          moving.push_back(static_cast<int64_t>(i));
      }
      trainer.fade(moving);
    }
    trainer.step();
  }
  scene_ = trainer.scene();
  const Votes votes = vote(scene_, capture, trainer.options().render);
  agreement_ = scene_;
  Surfels& grey = agreement_.main;
  grey.sh.reset({grey.count(), 1, 3});
  std::vector<int64_t> agreed;
  for (int64_t i = 0; i < grey.count(); ++i) {
    const auto share = static_cast<float>(votes.share(static_cast<size_t>(i)));
    if (share >= most_agree && votes.shown[static_cast<size_t>(i)] >= least_shown) agreed.push_back(i);
    for (int64_t c = 0; c < 3; ++c) grey.sh(i, 0, c) = (share - 0.5F) / static_cast<float>(sh_c0);
  }
  agreed_.resize({static_cast<int64_t>(agreed.size()), 3});
  for (size_t k = 0; k < agreed.size(); ++k)
    std::copy_n(grey.position.row(agreed[k]), 3, agreed_.row(static_cast<int64_t>(k)));
}

Tensor<float> StillScene::standing(const Tensor<float>& points) const {
  constexpr float beside = 1.5F;  // in distances between neighbours
  if (points.empty() || agreed_.empty()) return Tensor<float>({0, 3});
  const Tensor<int32_t> nearest = nearest_of(agreed_, points);
  const Tensor<float> log_distance = log_spacing(points);
  Tensor<float> result(points.shape());
  int64_t count = 0;
  for (int64_t i = 0; i < points.dim(0); ++i) {
    const Vec3<float> point = load3<float>(points.row(i));
    const float distance = glm::length(point - load3<float>(agreed_.row(nearest[i])));
    if (distance <= beside * std::exp(log_distance[i])) store3(result.row(count++), point);
  }
  result.resize({count, 3});
  return result;
}

StillScene::Look StillScene::look(const View& view) {
  Look result;
  result.colour = renderer_.forward(scene_, request_of(view, scene_), false).colour;
  const Tensor<float> grey =
      agreement_renderer_.forward(agreement_, request_of(view, agreement_), false).raster.colour;
  result.agreement.resize({grey.dim(0), grey.dim(1)});
  for (int64_t i = 0; i < result.agreement.size(); ++i) result.agreement[i] = grey[3 * i];
  return result;
}

}  // namespace traceflow
