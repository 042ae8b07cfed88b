#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "capture/motion_truth.h"
#include "math/rotation.h"
#include "math/similarity_fit.h"
#include "track/bodies.h"
#include "train/initialise.h"
#include "train/small_run.h"

// A capture whose things move, and how well they are followed.
namespace traceflow {

// Two things that turn and come closer (docs/synth.md), every 24th of their way a picture.
inline const fs::path& tumbling() {
  static const fs::path folder = [] {
    fs::path path = fs::path(::testing::TempDir()) / ("tumbling_" + std::to_string(::getpid()));
    SynthOptions options;
    options.scene = SynthScene::tumble;
    options.frames = 25;
    options.width = 120;
    options.height = 68;
    options.samples = 1;
    options.points = 4000;
    write_synthetic_capture(options, path);
    return path;
  }();
  return folder;
}

struct Tumbling {
  Capture capture = load_capture(tumbling(), {});
  Scene scene;

  explicit Tumbling(const std::string& kind = "nodes") {
    TrainOptions options = preset("cpu");
    options.deform.kind = kind;
    Random random(1);
    scene = initial_scene(capture, options, random).scene;
  }
};

// The true points of a thing (scene units), at a time's index.
inline std::vector<Vec3<double>> true_points(const Capture& capture, const MotionTruth& truth, int32_t object,
                                             int64_t at) {
  std::vector<Vec3<double>> points;
  for (int64_t i = 0; i < truth.object.size(); ++i) {
    if (truth.object[i] == object)
      points.push_back(capture.normalisation.in_scene(load3<double>(&truth.points(at, i, 0))));
  }
  return points;
}

inline double least_distance(const Vec3<double>& x, const std::vector<Vec3<double>>& points) {
  double least = 1e9;
  for (const Vec3<double>& p : points) least = std::min(least, length(x - p));
  return least;
}

// The thing that a body is: whose points its surfels are nearest to.
inline int32_t thing_of(const Tumbling& at, const MotionTruth& truth, int32_t body) {
  double best = 1e9;
  int32_t thing = -1;
  for (const int32_t object : {0, 1}) {
    const double d = least_distance(load3<double>(at.scene.main_motion->centre.row(body)),
                                    true_points(at.capture, truth, object, 0));
    if (d < best) {
      best = d;
      thing = object;
    }
  }
  return thing;
}

// How well bodies are followed a third of the way by masks and normals, and a shape that was trained on the
// first picture for a moment.
inline void expect_to_be_followed(const Capture& capture) {
  Tumbling at;
  const std::optional<MotionTruth> truth = load_motion_truth(at.capture);
  TrainOptions options = preset("cpu");
  options.deform.kind = "nodes";
  options.iterations = 400;
  options.specular = Specular::none;
  options.initial.max_points = options.density.max_surfels = 4000;
  constexpr int64_t last = 12;
  const int until = options.iterations / 8 + static_cast<int>(last) * options.deform.track.map_each;
  Trainer trainer(options, capture, fs::path(::testing::TempDir()) / "followed");
  while (trainer.iteration() < until) trainer.step();
  at.scene.main_motion = trainer.scene().main_motion;
  const Motion& motion = *at.scene.main_motion;
  ASSERT_EQ(motion.bodies(), 2);
  std::set<int32_t> things;
  for (const int32_t body : {0, 1}) {
    const int32_t thing = thing_of(at, *truth, body);
    things.insert(thing);
    const auto from = true_points(at.capture, *truth, thing, 0),
               to = true_points(at.capture, *truth, thing, last);
    const Similarity expected = fit_similarity(from, to);
    const Vec3<double> centre = load3<double>(motion.centre.row(body)),
                       shift = load3<double>(&motion.shift(body, last, 0));
    const Mat3<double> turn = rotation_from_quaternion(load4<double>(&motion.rotation(body, last, 0)));
    std::vector<double> moved, missed;
    for (size_t i = 0; i < from.size(); ++i) {
      moved.push_back(length(to[i] - from[i]));
      missed.push_back(length(turn * (from[i] - centre) + centre + shift - to[i]));
    }
    std::sort(moved.begin(), moved.end());
    std::sort(missed.begin(), missed.end());
    EXPECT_LT(missed[missed.size() / 2], 0.6 * moved[moved.size() / 2]) << body;
    EXPECT_LT(rotation_angle_deg(turn * transpose(expected.rotation)),
              0.6 * rotation_angle_deg(expected.rotation))
        << body;
  }
  EXPECT_EQ(things.size(), 2U);
}

}  // namespace traceflow
