#include "train/camera_refinement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "math/rotation_group.h"
#include "support/refusal.h"
#include "support/temp_folder.h"
#include "train/camera_alignment.h"
#include "train/objective.h"
#include "train/small_run.h"

namespace traceflow {
namespace {

using ::testing::HasSubstr;

Vec3<double> random_vector(Random& random, double size) {
  return {size * random.normal(), size * random.normal(), size * random.normal()};
}

Mat3<double> rotation(const Vec3<double>& turn) { return rotation_from_quaternion(quaternion_exp(turn)); }

// Cameras here and there, turned anyhow.
std::vector<View> some_views(int count) {
  Random random(5);
  std::vector<View> views(static_cast<size_t>(count));
  for (View& view : views) {
    view.camera.position = Vec3<float>(random_vector(random, 2));
    view.camera.camera_from_world = Mat3<float>(rotation(random_vector(random, 1)));
  }
  return views;
}

// One whose pose gradient is (turn, shift).
CameraGradient<float> gradient_of(const Camera<float>& camera, const Vec3<double>& turn,
                                  const Vec3<double>& shift) {
  const Mat3<double> skew(Vec3<double>(0, -turn.z, turn.y), Vec3<double>(turn.z, 0, -turn.x),
                          Vec3<double>(-turn.y, turn.x, 0));
  CameraGradient<float> gradient;
  gradient.camera_from_world = Mat3<float>(Mat3<double>(camera.camera_from_world) * skew * 0.5);
  gradient.position = Vec3<float>(shift);
  return gradient;
}

// A loss that is linear in the camera's matrix and centre, against central differences along each turn and
// shift.
TEST(CameraRefinement, ThePoseGradientIsThatOfTheMovedCamera) {
  Random random(3);
  for (const View& view : some_views(5)) {
    CameraGradient<float> weights;
    for (int c = 0; c < 3; ++c) weights.camera_from_world[c] = Vec3<float>(random_vector(random, 1));
    weights.position = Vec3<float>(random_vector(random, 1));
    const auto loss = [&](const Camera<float>& camera) {
      double sum = dot(Vec3<double>(weights.position), Vec3<double>(camera.position));
      for (int c = 0; c < 3; ++c)
        sum += dot(Vec3<double>(weights.camera_from_world[c]), Vec3<double>(camera.camera_from_world[c]));
      return sum;
    };
    const std::array<double, 6> gradient = pose_gradient(view.camera, weights);
    for (size_t i = 0; i < 6; ++i) {
      constexpr double step = 1e-2;
      const auto at = [&](double by) {
        Vec3<double> turn(0), shift(0);
        (i < 3 ? turn : shift)[static_cast<int>(i % 3)] = by;
        return loss(moved(view.camera, turn, shift));
      };
      EXPECT_NEAR(gradient[i], (at(step) - at(-step)) / (2 * step), 2e-3) << i;
    }
  }
}

// Where the gradients of all cameras ask for the same turn about one point and the same shift, all together
// would move: the scene can do that instead.
TEST(CameraRefinement, HoldsNoMotionOfAllCamerasTogether) {
  constexpr double rate = 1e-3;
  constexpr int views = 12;
  const optimize::AdamOptions adam;
  const std::vector<View> given = some_views(views);
  const auto largest_shift = [&](bool alike) {
    CameraRefinement cameras(given);
    for (int64_t view = 0; view < views; ++view) {
      const double sign = alike || view % 2 == 0 ? 1 : -1;
      cameras.step(view, gradient_of(cameras.camera(view), {}, {sign, sign, -sign}), rate, 1, adam);
    }
    double largest = 0;
    for (const double value : cameras.corrections().shift.values())
      largest = std::max(largest, std::abs(value));
    return largest;
  };
  EXPECT_LT(largest_shift(true), 1e-3 * rate);
  EXPECT_GT(largest_shift(false), 0.5 * rate);

  // Whatever is asked for, what is left fits no shift, turn or growth of all.
  Random random(9);
  CameraRefinement cameras(given);
  for (int i = 0; i < 100; ++i) {
    const auto view = static_cast<int64_t>(random.below(views));
    cameras.step(view, gradient_of(cameras.camera(view), random_vector(random, 1), random_vector(random, 1)),
                 rate, 2, adam);
  }
  Vec3<double> middle(0), shift(0), turn(0);
  for (const View& view : given) middle += Vec3<double>(view.camera.position) / double(views);
  double growth = 0, spread = 0, size = 0;
  for (int64_t i = 0; i < views; ++i) {
    const Vec3<double> r = Vec3<double>(given[static_cast<size_t>(i)].camera.position) - middle;
    spread += dot(r, r) / views;
  }
  for (int64_t i = 0; i < views; ++i) {
    const Vec3<double> r = Vec3<double>(given[static_cast<size_t>(i)].camera.position) - middle;
    const Vec3<double> s = load3<double>(cameras.corrections().shift.row(i));
    shift += s;
    growth += dot(r, s);
    turn += cross(r, s) / spread + load3<double>(cameras.corrections().turn.row(i));
    size += length(s);
  }
  EXPECT_GT(size, 10 * rate);
  EXPECT_LT(length(shift), 1e-6 * size);
  EXPECT_LT(std::abs(growth), 1e-6 * size);
  EXPECT_LT(length(turn), 1e-3 * size) << "turns compose to first order alone";
}

// A scene drawn from a camera is the photograph; from a camera beside it the way is found back.
TEST(CameraAlignment, FindsTheCameraOfAPicture) {
  TrainOptions options = small_run(60);
  options.specular = Specular::none;
  Trainer trainer = make_trainer(options, "aligned");
  trainer.run(never);
  Renderer renderer(options.render);
  FrameRequest request;
  request.camera = trainer.capture().train[0].camera;
  const Camera<float> truth = request.camera;
  ViewImages photograph;
  photograph.colour = renderer.forward(trainer.scene(), request).colour;

  const Vec3<double> turn(4e-3, -3e-3, 5e-3), shift(4e-3, 5e-3, -3e-3);
  request.camera = moved(truth, turn, shift);
  const Camera<float> found = aligned_camera(renderer, trainer.scene(), request, photograph, options.loss);
  const auto difference = [&](const Camera<float>& camera) {
    request.camera = camera;
    const Tensor<float> picture = renderer.forward(trainer.scene(), request).colour;
    double sum = 0;
    for (int64_t i = 0; i < picture.size(); ++i) sum += std::abs(picture[i] - photograph.colour[i]);
    return sum;
  };
  EXPECT_LT(difference(found), 0.2 * difference(moved(truth, turn, shift)));
}

// How far points appear from where the true cameras see them, in pixels (root mean square), but for what is
// common to all views.
double pixels_off(const Capture& capture, const std::vector<Camera<float>>& truth) {
  const auto views = static_cast<double>(truth.size());
  double sum = 0;
  int64_t count = 0;
  for (int64_t p = 0; p < capture.points.shape()[0]; ++p) {
    const Vec3<float> point = load3<float>(capture.points.row(p));
    std::vector<Vec2<double>> off;
    Vec2<double> mean(0);
    for (size_t i = 0; i < truth.size(); ++i) {
      const Camera<float>& camera = capture.train[i].camera;
      off.emplace_back(camera.project(camera.point_in_camera(point)) -
                       truth[i].project(truth[i].point_in_camera(point)));
      mean += off.back() / views;
    }
    const bool is_seen = std::all_of(truth.begin(), truth.end(),
                                     [&](const Camera<float>& camera) { return camera.sees(point, 0.1F); });
    if (!is_seen) continue;
    for (const Vec2<double>& x : off) sum += dot(x - mean, x - mean);
    count += static_cast<int64_t>(truth.size());
  }
  return std::sqrt(sum / static_cast<double>(count));
}

// Cameras that are wrong by pixels come nearer to where they were.
TEST(CameraRefinement, TrainingTakesCamerasBack) {
  const TempFolder folder;
  SynthOptions synth;
  synth.frames = 12;
  synth.width = 96;
  synth.height = 54;
  synth.samples = 2;
  synth.points = 1500;
  write_synthetic_capture(synth, folder.path());
  Capture capture = load_capture(folder.path(), {});
  Random random(7);
  std::vector<Camera<float>> truth;
  for (View& view : capture.train) {
    truth.push_back(view.camera);
    view.camera = moved(view.camera, random_vector(random, 0.01), random_vector(random, 0.01));
  }
  const double before = pixels_off(capture, truth);
  TrainOptions options = small_run(500);
  options.specular = Specular::none;
  options.deform.main = false;  // else the field moves what the cameras are off by
  options.density.max_surfels = synth.points;
  options.rates.camera = 2e-3F;
  Trainer trainer(options, std::move(capture), folder.path() / "run");
  trainer.run(never);
  EXPECT_GT(before, 1);
  EXPECT_LT(pixels_off(trainer.capture(), truth), 0.65 * before);
}

TEST(CameraRefinement, CorrectionsThatDoNotFitAreRefused) {
  const std::vector<View> views = some_views(3);
  CameraRefinement cameras(views);
  cameras.step(1, gradient_of(cameras.camera(1), {1, 2, 3}, {1, 0, 0}), 1e-3, 1, {});
  Safetensors file;
  cameras.put(file);
  CameraRefinement again(views);
  again.get(file);
  for (int64_t i = 0; i < 3; ++i)
    EXPECT_EQ(again.camera(i).camera_from_world, cameras.camera(i).camera_from_world);
  CameraRefinement fewer(some_views(2));
  EXPECT_THAT(refusal_of([&] { fewer.get(file); }), HasSubstr("cameras/turn: found 3x3, expected 2x3"));
  EXPECT_THAT(refusal_of([&] { corrections_in(file).applied(views[0].camera, 3); }),
              HasSubstr("cameras/turn: found 3 views"));
}

}  // namespace
}  // namespace traceflow
