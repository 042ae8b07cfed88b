#include "track/rescale.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "math/rotation_group.h"
#include "ops/deform/deform.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"
#include "track/ball_body.h"
#include "train/tumbling.h"

namespace traceflow {
namespace {

// A ball that turns and shifts, and a camera that moves beside it.
struct MovingBall {
  Surfels surfels = ball_body::ball();
  Motion motion;
  std::vector<Vec3<double>> eyes;

  MovingBall() {
    Tensor<float> pivot({1, 3});
    store3(pivot.row(0), ball_body::centre + Vec3<double>(0.1, 0, -0.1));
    motion = still_motion(pivot, tensor_of(std::vector<float>{0, 0.5, 1}));
    for (int64_t key = 0; key < 3; ++key) {
      const auto k = static_cast<double>(key);
      const Vec4<double> turn = quaternion_exp(Vec3<double>(0.2, -0.3, 0.1) * k);
      for (int c = 0; c < 4; ++c) motion.rotation(0, key, c) = static_cast<float>(turn[c]);
      store3(&motion.shift(0, key, 0), Vec3<double>(0.1, -0.05, 0.3) * k);
      eyes.push_back(Vec3<double>(0.05, 0.1, -0.1) * k);
    }
  }

  raster::Output picture(int64_t key) const {
    Camera<float> camera;
    camera.width = camera.height = 64;
    camera.focal_x = camera.focal_y = 90;
    camera.centre_x = camera.centre_y = 32;
    camera.position = Vec3<float>(eyes[static_cast<size_t>(key)]);
    PosedSurfels posed;
    deform::forward(surfels, nullptr, 0, {}, 0, field::Precision::fp32, posed, nullptr);
    const motion::SavedPtr moved = motion::make_saved();
    motion::forward(motion, surfels.body, motion.time[key], {}, posed, *moved);
    raster::Output out;
    raster::forward(posed, camera, {}, out, nullptr);
    return out;
  }
};

double area(const raster::Output& picture) {
  return std::accumulate(picture.alpha.values().begin(), picture.alpha.values().end(), 0.0);
}

TEST(Rescale, ChangesTheFirstPictureAlone) {
  constexpr double ratio = 1.08;
  MovingBall at;
  std::vector<raster::Output> before;
  for (int64_t key = 0; key < 3; ++key) before.push_back(at.picture(key));
  rescale_bodies({ratio}, at.eyes, 1, at.surfels, at.motion);
  for (int64_t key = 0; key < 3; ++key) {
    const raster::Output& was = before[static_cast<size_t>(key)];
    const raster::Output is = at.picture(key);
    if (key == 0) {
      EXPECT_NEAR(area(was) / area(is), ratio * ratio, 0.02);
      continue;
    }
    for (int64_t i = 0; i < was.alpha.size(); ++i) {
      ASSERT_NEAR(is.alpha[i], was.alpha[i], 2e-3) << key << " " << i;
      ASSERT_NEAR(is.colour[3 * i], was.colour[3 * i], 2e-3) << key << " " << i;
      if (was.alpha[i] < 0.9F) continue;
      ASSERT_NEAR(was.depth[i] / is.depth[i], ratio, 2e-3) << key << " " << i;
    }
  }
}

// From the first key on, no camera sees a difference.
TEST(Rescale, ChangesNoPictureWhereAllDistancesChange) {
  MovingBall at;
  std::vector<raster::Output> before;
  for (int64_t key = 0; key < 3; ++key) before.push_back(at.picture(key));
  rescale_bodies({1.08}, at.eyes, 0, at.surfels, at.motion);
  for (int64_t key = 0; key < 3; ++key) {
    const raster::Output& was = before[static_cast<size_t>(key)];
    const raster::Output is = at.picture(key);
    for (int64_t i = 0; i < was.alpha.size(); ++i) {
      ASSERT_NEAR(is.alpha[i], was.alpha[i], 2e-3) << key << " " << i;
      if (was.alpha[i] < 0.9F) continue;
      ASSERT_NEAR(was.depth[i] / is.depth[i], 1.08, 2e-3) << key << " " << i;
    }
  }
}

// The camera goes around: a ball that stands still would follow it if it were made larger.
TEST(Rescale, IsForWhatMoves) {
  MovingBall at;
  EXPECT_EQ(ratios_of_what_moves({1.02}, at.eyes, at.motion)[0], 1.02);
  at.motion.shift.fill(0);
  EXPECT_EQ(ratios_of_what_moves({1.02}, at.eyes, at.motion)[0], 1);
  EXPECT_EQ(ratios_of_what_moves({1}, at.eyes, at.motion)[0], 1);
}

TEST(Rescale, LeavesOthersAlone) {
  MovingBall at;
  at.surfels.body[0] = motionless;
  const Surfels before = at.surfels;
  rescale_bodies({1.08}, at.eyes, 1, at.surfels, at.motion);
  EXPECT_EQ(load3<float>(at.surfels.position.row(0)), load3<float>(before.position.row(0)));
  EXPECT_EQ(at.surfels.log_scale(0, 1), before.log_scale(0, 1));
  EXPECT_NE(at.surfels.log_scale(1, 1), before.log_scale(1, 1));
}

TEST(Rescale, OnlyOneCameraAtEachTimeLeavesTheSizeOpen) {
  Tumbling at;
  const Motion& motion = *at.scene.main_motion;
  const auto eyes = positions_of_single_cameras(at.capture, motion);
  ASSERT_TRUE(eyes);
  ASSERT_EQ(eyes->size(), static_cast<size_t>(motion.keys()));
  const auto view = std::ranges::find(at.capture.train, motion.time[3], &View::time);
  EXPECT_EQ((*eyes)[3], Vec3<double>(view->camera.position));
  at.capture.train.push_back(at.capture.train[2]);
  EXPECT_FALSE(positions_of_single_cameras(at.capture, motion));
}

// A column of nodes, each twice a radius above the other, that grows from its foot and leans, before a camera
// that moves.
struct GrowingColumn {
  static constexpr int64_t times = 7;
  Motion motion;
  Nodes nodes;
  std::vector<Vec3<double>> eyes;

  GrowingColumn() {
    constexpr int64_t count = 8, keys = 2 * times - 1;
    std::vector<float> time, key_time;
    for (int64_t k = 0; k < times; ++k) time.push_back(static_cast<float>(k) / (times - 1));
    for (int64_t k = 0; k < keys; ++k) key_time.push_back(static_cast<float>(k) / (keys - 1));
    Tensor<float> pivot({1, 3});
    store3(pivot.row(0), Vec3<double>(0.1, -0.2, 2));
    motion = still_motion(pivot, tensor_of(key_time));
    for (int64_t k = 0; k < keys; ++k)
      eyes.emplace_back(0.05 * static_cast<double>(k), 0.1, -0.02 * static_cast<double>(k));
    nodes.body.reset({count});
    nodes.time = tensor_of(time);
    nodes.centre.resize({count, 3});
    nodes.radius.resize({count});
    nodes.radius.fill(0.05F);
    for (Tensor<float>* values : {&nodes.turn, &nodes.shift, &nodes.anchor}) values->reset({count, times, 3});
    for (int64_t n = 0; n < count; ++n) {
      const double height = 0.1 * static_cast<double>(n);
      store3(nodes.centre.row(n), Vec3<double>(0, -height, 2));
      for (int64_t k = 0; k < times; ++k) {
        const double share = std::sin(3.14 * static_cast<double>(k) / (times - 1));
        const double grown = share * std::max(0.0, height - 0.25);
        store3(&nodes.shift(n, k, 0), Vec3<double>(0.3 * grown, -0.4 * grown, 0.2 * grown));
      }
    }
  }
};

TEST(Rescale, FindsTheSizesWithWhichAFootStands) {
  const GrowingColumn at;
  const std::vector<double> as_it_is = standing_ratios(at.eyes, at.motion, at.nodes, 0);
  for (const double ratio : as_it_is) EXPECT_NEAR(ratio, 1, 1e-9);
  // What looks the same, as large as at first and closer.
  std::vector<double> closer;
  for (int64_t k = 0; k < GrowingColumn::times; ++k)
    closer.push_back(1 - 0.06 * std::sin(3.14 * static_cast<double>(k) / (GrowingColumn::times - 1)));
  Motion motion = at.motion;
  Nodes nodes = at.nodes;
  rescale_bent_body(closer, at.eyes, 0, motion, nodes);
  const std::vector<double> found = standing_ratios(at.eyes, motion, nodes, 0);
  for (size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k] * closer[k], 1, 0.006) << k;
  // Where nodes rest does not matter, only where the first pose puts them.
  const Vec3<double> off(0.02, 0, 0.03);
  for (int64_t n = 0; n < nodes.count(); ++n)
    store3(nodes.centre.row(n), load3<double>(nodes.centre.row(n)) - off);
  for (int64_t key = 0; key < motion.keys(); ++key)
    store3(&motion.shift(0, key, 0), load3<double>(&motion.shift(0, key, 0)) + off);
  const std::vector<double> from_elsewhere = standing_ratios(at.eyes, motion, nodes, 0);
  for (size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(from_elsewhere[k], found[k], 0.0026) << k;
  // Nothing tells of what stands nowhere.
  for (int64_t i = 0; i < motion.shift.size(); i += 3) motion.shift[i] += i > 0 ? 2.0F : 0.0F;
  for (const double ratio : standing_ratios(at.eyes, motion, nodes, 0)) EXPECT_NEAR(ratio, 1, 1e-9);
}

TEST(Rescale, CamerasSeeTheNodesOfABentBodyWhereTheyDid) {
  const GrowingColumn at;
  Motion motion = at.motion;
  Nodes nodes = at.nodes;
  for (int64_t key = 0; key < motion.keys(); ++key) {
    const Vec4<double> turn = quaternion_exp(Vec3<double>(0.2, -0.1, 0.3) * static_cast<double>(key));
    for (int c = 0; c < 4; ++c) motion.rotation(0, key, c) = static_cast<float>(turn[c]);
    store3(&motion.shift(0, key, 0), 0.02 * static_cast<double>(key) * Vec3<double>(1, 2, -3));
  }
  const Motion motion_before = motion;
  const Nodes nodes_before = nodes;
  std::vector<double> ratios;
  for (int64_t k = 0; k < GrowingColumn::times; ++k) ratios.push_back(1 + 0.02 * static_cast<double>(k));
  rescale_bent_body(ratios, at.eyes, 0, motion, nodes);
  for (int64_t n = 0; n < nodes.count(); ++n) {
    for (int64_t k = 0; k < nodes.times(); ++k) {
      const Vec3<double> eye = at.eyes[static_cast<size_t>(2 * k)];
      const Vec3<double> was = nodes::place_of(nodes_before, motion_before, n, k) - eye;
      const Vec3<double> is = nodes::place_of(nodes, motion, n, k) - eye;
      EXPECT_LT(length(is - ratios[static_cast<size_t>(k)] * was), 1e-5);
    }
  }
}

// Bodies that are made larger are so much larger than the first picture shows them.
TEST(Tracker, TheFirstPictureTellsHowLargeBodiesAre) {
  constexpr double larger = 1.04;
  Tumbling at;
  at.scene.main.opacity_logit.fill(4);
  TrackOptions options;
  options.colour = 0;
  const Tracker tracker(options, Schedule(preset("cpu")).render(0), at.capture);
  const auto ratios = [&] {
    return tracker.distance_ratios(at.scene.main, *at.scene.main_motion, at.scene.extent, {options.steps, 1},
                                   {});
  };
  const std::vector<double> before = ratios();
  const std::vector<double> smaller(before.size(), 1 / larger);
  Motion motion = *at.scene.main_motion;
  rescale_bodies(smaller, *positions_of_single_cameras(at.capture, motion), 1, at.scene.main, motion);
  const std::vector<double> after = ratios();
  ASSERT_EQ(before.size(), 2U);
  for (const size_t b : {0, 1}) EXPECT_NEAR(after[b] / before[b], larger, 0.015) << b;
}

// The mean distance of each body's surfels from its centre.
std::vector<double> sizes(const Scene& scene) {
  const Motion& motion = *scene.main_motion;
  std::vector<double> sum(static_cast<size_t>(motion.bodies())), count(sum.size());
  for (int64_t i = 0; i < scene.main.count(); ++i) {
    if (scene.main.body[i] < 0) continue;
    const auto body = static_cast<size_t>(scene.main.body[i]);
    sum[body] += length(load3<double>(scene.main.position.row(i)) -
                        load3<double>(motion.centre.row(scene.main.body[i])));
    ++count[body];
  }
  for (size_t b = 0; b < sum.size(); ++b) sum[b] /= count[b];
  return sum;
}

// Where poses are solved again, rigid bodies become as large as the first picture shows them. Of bodies that
// bend it tells nothing. The light on bodies is taken along then, and only then.
TEST(Tracker, KeepsRigidBodiesAsLargeAsTheFirstPictureShowsThem) {
  const Tumbling at;
  for (const bool bends : {false, true}) {
    TrainOptions options = preset("cpu");
    options.iterations = 120;
    options.specular = Specular::none;
    options.initial.max_points = options.density.max_surfels = 2000;
    options.density.from = options.iterations;
    // With these the points say another distance than the first picture.
    options.loss.normal_prior = 2;
    TrackOptions& track = options.deform.track;
    track.map_each = 1;
    track.again = 0;
    track.colour = 0;
    options.deform.bend.nodes = bends ? 4 : 0;
    options.deform.bend.misfit = 0;
    Trainer trainer(options, at.capture, fs::path(::testing::TempDir()) / "sizes");
    while (trainer.iteration() < 2 * options.iterations / track.rounds) trainer.step();
    const Scene& scene = trainer.scene();
    ASSERT_EQ(scene.main_nodes.has_value(), bends);
    const Tracker tracker(track, Schedule(options).render(trainer.iteration()), at.capture);
    std::vector<double> ratios = tracker.distance_ratios(scene.main, *scene.main_motion, scene.extent,
                                                         {track.steps, 0.35 * track.blur}, {});
    const std::vector<double> before = sizes(scene);
    const double shown = std::abs(ratios[0] - 1);
    // Then they are put as far away as the points are.
    Surfels main = scene.main;
    Motion motion = *scene.main_motion;
    const std::vector<Vec3<double>> eyes = *positions_of_single_cameras(at.capture, motion);
    rescale_bodies(ratios, eyes, 1, main, motion);
    std::vector<double> by_points = tracker.distances_by_points(main, motion, scene.extent);
    for (double& ratio : by_points) ratio = 1 / ratio;
    by_points = ratios_of_what_moves(by_points, eyes, motion);
    EXPECT_GT(std::abs(by_points[0] - 1), 1e-3);
    for (size_t b = 0; b < ratios.size(); ++b) ratios[b] *= by_points[b];
    const auto lit = [&] {
      const auto& centre = trainer.scene().lighting->centre.values();
      return std::vector<float>(centre.begin(), centre.end());
    };
    std::vector<float> lit_before = lit();
    trainer.step();
    EXPECT_NE(lit(), lit_before);
    const std::vector<double> after = sizes(trainer.scene());
    lit_before = lit();
    trainer.step();
    EXPECT_EQ(lit(), lit_before);
    for (size_t b = 0; b < before.size(); ++b)
      EXPECT_NEAR(before[b] / after[b], bends ? 1 : ratios[b], 5e-4) << b;
    EXPECT_GT(shown, 0.01);
  }
}

}  // namespace
}  // namespace traceflow
