#include "track/bodies.h"
#include "track/ball_body.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/parallel.h"
#include "capture/motion_truth.h"
#include "files/png.h"
#include "math/activation.h"
#include "math/rotation.h"
#include "math/rotation_group.h"
#include "math/similarity_fit.h"
#include "support/refusal.h"
#include "track/mask_parts.h"
#include "track/tracker.h"
#include "train/initialise.h"
#include "train/small_run.h"
#include "train/tumbling.h"

namespace traceflow {
namespace {

TEST(Bodies, AreTheThingsOfTheMask) {
  const Tumbling at;
  const std::optional<MotionTruth> truth = load_motion_truth(at.capture);
  ASSERT_TRUE(truth && at.scene.main_motion);
  ASSERT_EQ(at.scene.main_motion->bodies(), 2);
  ASSERT_EQ(at.scene.main_motion->keys(), 25);
  const double unit = at.capture.normalisation.scale;  // a metre
  std::set<int32_t> things;
  for (const int32_t body : {0, 1}) {
    const int32_t thing = thing_of(at, *truth, body);
    things.insert(thing);
    const auto points = true_points(at.capture, *truth, thing, 0);
    int64_t carried = 0, near = 0;
    for (int64_t i = 0; i < at.scene.main.count(); ++i) {
      if (at.scene.main.body[i] != body) continue;
      ++carried;
      // Their back is not among the points that the first view sees: a thing is 0.4 m across.
      near += least_distance(load3<double>(at.scene.main.position.row(i)), points) < 0.25 * unit ? 1 : 0;
    }
    EXPECT_GT(carried, 100);
    EXPECT_GT(static_cast<double>(near), 0.9 * static_cast<double>(carried));
  }
  EXPECT_EQ(things.size(), 2U);
  // What the first view sees of the things is carried.
  int64_t on_things = 0, left = 0;
  for (int64_t i = 0; i < at.scene.main.count(); ++i) {
    const Vec3<double> x = load3<double>(at.scene.main.position.row(i));
    if (std::min(least_distance(x, true_points(at.capture, *truth, 0, 0)),
                 least_distance(x, true_points(at.capture, *truth, 1, 0))) > 0.01 * unit)
      continue;
    ++on_things;
    left += at.scene.main.body[i] < 0 ? 1 : 0;
  }
  EXPECT_GT(on_things, 200);
  EXPECT_LT(static_cast<double>(left), 0.1 * static_cast<double>(on_things));
}

TEST(Bodies, ThereAreNoneWithoutMasksOrWhereTheNetworkMovesSurfels) {
  EXPECT_TRUE(Tumbling().scene.main_motion);
  Tumbling at("network");
  EXPECT_FALSE(at.scene.main_motion);
  EXPECT_TRUE(at.scene.main_field);
  for (View& view : at.capture.train) view.time += 1;
  Capture bare = at.capture;
  bare.has_masks = false;
  TrainOptions options = preset("cpu");
  Random random(1);
  const Scene scene = initial_scene(bare, options, random).scene;
  EXPECT_FALSE(scene.main_motion);
  EXPECT_TRUE(scene.main.body.empty());
  EXPECT_TRUE(scene.main_field);
}

TEST(Tracker, FollowsBodiesFromTimeToTime) { expect_to_be_followed(load_capture(tumbling(), {})); }

// A copy of the capture with masks of training views changed: by f(its place in time, mask).
template <class F>
fs::path with_masks(const std::string& name, F&& change) {
  const fs::path folder = fs::path(::testing::TempDir()) / (name + std::to_string(::getpid()));
  fs::copy(tumbling(), folder, fs::copy_options::recursive);
  const Capture whole = load_capture(tumbling(), {});
  for (size_t k = 0; k < whole.train.size(); ++k) {
    Tensor<uint8_t> mask = load_images(whole, whole.train[k])->mask;
    change(k, mask);
    for (uint8_t& pixel : mask.values()) pixel = pixel != 0 ? 255 : 0;
    write_png(folder / "mask/1x" / (whole.train[k].id + ".png.png"), mask);
  }
  return folder;
}

TEST(Tracker, FollowsBodiesPastMasksThatAreBlankOrWhole) {
  const fs::path folder = with_masks("blank_masks", [](size_t k, Tensor<uint8_t>& mask) {
    if (k == 0 || k == 3 || k == 4) mask.fill(0);
    if (k == 6) mask.fill(1);
  });
  expect_to_be_followed(load_capture(folder, {}));
}

// In the first mask the two things hang together.
fs::path with_things_joined(const std::string& name) {
  return with_masks(name, [](size_t k, Tensor<uint8_t>& mask) {
    if (k > 0) return;
    const std::vector<std::vector<int64_t>> parts = mask_parts(mask);
    ASSERT_GE(parts.size(), 2U);
    const int64_t width = mask.dim(1), a = parts[0][parts[0].size() / 2], b = parts[1][parts[1].size() / 2];
    for (int64_t x = std::min(a % width, b % width); x <= std::max(a % width, b % width); ++x) {
      for (int64_t y = std::min(a, b) / width - 1; y <= std::max(a, b) / width + 1; ++y) mask(y, x) = 1;
    }
  });
}

TEST(Tracker, PartsABodyWhoseThingsMoveApart) {
  expect_to_be_followed(load_capture(with_things_joined("joined_masks"), {}));
}

// A ball that mirrors does not go on to turn as it did before: nothing tells its turns.
TEST(Tracker, ABallThatMirrorsDoesNotTurnOn) {
  const Tumbling at;
  const TrainOptions options = preset("cpu");
  Motion motion = *at.scene.main_motion;
  const auto turn_of = [&](int64_t body, int64_t from, int64_t to) {
    return length(quaternion_log(quaternion_product(
        unit_quaternion(load4<double>(&motion.rotation(body, to, 0))),
        quaternion_conjugate(unit_quaternion(load4<double>(&motion.rotation(body, from, 0)))))));
  };
  TextureTrust trust = TextureTrust::of(motion.bodies());
  for (int64_t body = 0; body < motion.bodies(); ++body) {
    trust.stiffness(body, 2) = 1e6;  // that many pictures, none of which told its turns
    trust.mirror_image(body, 0) = 1;
    const Vec4<double> turned = quaternion_exp(Vec3<double>(0.1, 0.2, 0.1));
    for (int c = 0; c < 4; ++c) motion.rotation(body, 1, c) = static_cast<float>(turned[c]);
  }
  Tracker(options.deform.track, Schedule(options).render(0), at.capture)
      .follow(at.scene.main, motion, 2, at.scene.extent, trust);
  for (int64_t body = 0; body < motion.bodies(); ++body) {
    EXPECT_GT(turn_of(body, 0, 1), 0.2);
    EXPECT_LT(turn_of(body, 1, 2), 0.02) << body;
  }
}

// Poses from the truth carry each true point where it truly is, before the first iteration and after the
// last.
TEST(TruePoses, CarryTruePointsAndStay) {
  const Tumbling at;
  const std::optional<MotionTruth> truth = load_motion_truth(at.capture);
  TrainOptions options = preset("cpu");
  options.iterations = 60;
  options.initial.max_points = options.density.max_surfels = 1500;
  options.environment_density.max_surfels = 400;
  options.deform.track.map_each = 1;
  options.deform.track.true_poses = true;
  Trainer trainer(options, at.capture, fs::path(::testing::TempDir()) / "true_poses");
  const auto farthest_miss = [&] {
    const Motion& motion = *trainer.scene().main_motion;
    double most = 0;
    for (const int32_t body : {0, 1}) {
      const int32_t thing = thing_of(at, *truth, body);
      const auto from = true_points(at.capture, *truth, thing, 0);
      const Vec3<double> centre = load3<double>(motion.centre.row(body));
      for (int64_t key = 0; key < motion.keys(); ++key) {
        const auto to = true_points(at.capture, *truth, thing, key);
        const Vec3<double> shift = load3<double>(&motion.shift(body, key, 0));
        const Mat3<double> turn = rotation_from_quaternion(load4<double>(&motion.rotation(body, key, 0)));
        for (size_t i = 0; i < from.size(); ++i)
          most = std::max(most, length(turn * (from[i] - centre) + centre + shift - to[i]));
      }
    }
    return most;
  };
  EXPECT_LT(farthest_miss(), 1e-4 * at.capture.extent);
  while (trainer.iteration() < options.iterations) trainer.step();
  EXPECT_LT(farthest_miss(), 1e-4 * at.capture.extent);

  const fs::path bare = fs::path(::testing::TempDir()) / ("bare_" + std::to_string(::getpid()));
  fs::copy(tumbling(), bare, fs::copy_options::recursive);
  fs::remove_all(bare / "truth");
  const Capture without = load_capture(bare, {});
  Random random(1);
  EXPECT_NE(refusal_of([&] { initial_scene(without, options, random); }).find("truth/motion"),
            std::string::npos);
}

// While bodies are followed nothing is mirrored and nothing multiplies; behind that everything trains.
// Few surfels, followed by a step a time.
TrainOptions little_following() {
  TrainOptions options = preset("cpu");
  options.iterations = 120;
  options.initial.max_points = options.density.max_surfels = 1500;
  options.environment_density.max_surfels = 400;
  options.deform.track.map_each = 1;
  options.deform.track.steps = options.deform.track.again = 1;
  return options;
}

// The photographs vanish in the very iteration in which a body is parted.
TEST(Tracker, ABodyWhosePartingFailsIsPartedAgain) {
  const fs::path folder = with_things_joined("fleeting_masks"), gone = folder.string() + "_gone",
                 run = folder.string() + "_run";
  TrainOptions options = little_following();
  options.specular = Specular::none;
  options.deform.track.steps = 4;
  options.capture.cache_mebibytes = 0;
  int64_t parted = 0;
  {
    Trainer trainer(options, load_capture(folder, options.capture), run);
    trainer.stream().listen([&](const events::Event& event) {
      if (!std::holds_alternative<events::BodiesParted>(event)) return;
      parted = trainer.iteration();
      fs::rename(folder, gone);
    });
    const events::Finished end = trainer.run(never);
    EXPECT_EQ(end.ending, events::Ending::no_input);
    ASSERT_GT(parted, 0);
    EXPECT_EQ(end.iteration, parted);
    EXPECT_EQ(trainer.scene().main_motion->bodies(), 1);
  }
  fs::rename(gone, folder);
  Trainer resumed(options, load_capture(folder, options.capture), run);
  resumed.resume();
  Trainer whole(options, load_capture(folder, options.capture), folder.string() + "_whole");
  for (Trainer* trainer : {&resumed, &whole}) {
    while (trainer->iteration() < parted + 3) trainer->step();
    EXPECT_EQ(trainer->scene().main_motion->bodies(), 2);
  }
  EXPECT_EQ(scene_bytes(resumed.scene()), scene_bytes(whole.scene()));
}

TEST(Tracker, LeavesReflectionsAloneAndAddsOnlySurfaceOfBodiesWhileTheyAreFollowed) {
  const Tumbling at;
  TrainOptions options = little_following();
  options.density.max_surfels = 2000;
  options.deform.track.steps = 8;
  Trainer trainer(options, at.capture, fs::path(::testing::TempDir()) / "left_alone");
  const auto keys = static_cast<int>(trainer.scene().main_motion->keys());
  const Scene first = trainer.scene();
  const auto same = [](const Tensor<float>& a, const Tensor<float>& b) {
    return std::ranges::equal(a.values(), b.values());
  };
  const auto rests = [&] {
    const Surfels& now = trainer.scene().environment;
    const auto tints =
        trainer.scene().main.tint_logit.values().first(static_cast<size_t>(first.main.count()));
    return now.count() == first.environment.count() && same(now.position, first.environment.position) &&
           same(now.sh, first.environment.sh) && std::ranges::equal(tints, first.main.tint_logit.values());
  };
  while (trainer.iteration() < options.iterations / 8 + keys - 1) trainer.step();
  EXPECT_TRUE(rests());
  const Surfels& main = trainer.scene().main;
  EXPECT_GT(main.count(), first.main.count());
  int64_t let_go = 0;
  for (int64_t i = first.main.count(); i < main.count(); ++i) {
    if (main.body[i] >= 0) continue;
    ++let_go;
    EXPECT_LT(main.opacity_logit[i], -5);  // transparent
  }
  EXPECT_GT(let_go, 0);
  EXPECT_LT(let_go, (main.count() - first.main.count()) / 2);
  EXPECT_FALSE(same(trainer.scene().main.position, first.main.position));
  while (trainer.iteration() < options.iterations) trainer.step();
  EXPECT_FALSE(rests());
}

// What is carried is narrowed, the widest the most, and nothing else changes in size.
TEST(Bodies, StartSolidAndNarrow) {
  Surfels surfels = ball_body::ball();
  const Motion motion = ball_body::turned_by(Vec3<double>(0));
  const float median = surfels.log_scale[0];
  surfels.body[5] = -1;
  for (const int64_t i : {3, 4, 5}) surfels.log_scale(i, 0) = median + 1;
  surfels.log_scale(7, 1) = median + 0.2F;
  const Surfels before = surfels;
  make_solid(motion, surfels);
  for (int64_t i = 0; i < surfels.count(); ++i) {
    const bool is_carried = i != 5;
    EXPECT_FLOAT_EQ(sigmoid(surfels.opacity_logit[i]), is_carried ? solid_opacity : sigmoid(4.0F));
    for (int k = 0; k < 2; ++k) {
      const float most = median + std::log(1.5F), started = before.log_scale(i, k);
      const float expected = is_carried ? std::min(started, most) + std::log(0.6F) : started;
      EXPECT_FLOAT_EQ(surfels.log_scale(i, k), expected) << i;
    }
  }
}

// Of points that bodies carry opacities learn when the film has been followed; others learn from the start.
TEST(Tracker, KeepsBodiesSolidWhileTheyAreFollowed) {
  const Tumbling at;
  const TrainOptions options = little_following();
  Trainer trainer(options, at.capture, fs::path(::testing::TempDir()) / "solid");
  const auto keys = static_cast<int>(trainer.scene().main_motion->keys());
  const Scene first = trainer.scene();
  while (trainer.iteration() < options.iterations / 8 + keys - 1) trainer.step();
  const Surfels& main = trainer.scene().main;
  int64_t carried = 0, free = 0, let_go = 0;
  for (int64_t i = 0; i < first.main.count(); ++i) {
    if (main.body[i] >= 0) {
      ++carried;
      EXPECT_NEAR(sigmoid(main.opacity_logit[i]), solid_opacity, 1e-5);
    } else if (first.main.body[i] >= 0) {
      ++let_go;
      EXPECT_LT(sigmoid(main.opacity_logit[i]), 0.9F);
      EXPECT_GT(main.log_scale(i, 0), first.main.log_scale(i, 0) + 0.1F);  // not narrow any more
    } else {
      free += main.opacity_logit[i] != first.main.opacity_logit[i] ? 1 : 0;
    }
  }
  EXPECT_GT(carried, 100);
  EXPECT_GT(free, 100);
  EXPECT_GT(let_go, 0);
  trainer.step();
  trainer.step();
  int64_t learns = 0;
  for (int64_t i = 0; i < first.main.count(); ++i) {
    if (main.body[i] >= 0) learns += std::abs(sigmoid(main.opacity_logit[i]) - solid_opacity) > 1e-4F;
  }
  EXPECT_GT(learns, carried / 4);
}

TEST(Tracker, AViewMovesThePosesOfTimesNearItButNotTheFirst) {
  const Tumbling at;
  const TrainOptions options = little_following();
  Trainer trainer(options, at.capture, fs::path(::testing::TempDir()) / "shared");
  const auto keys = static_cast<int>(trainer.scene().main_motion->keys());
  // All poses are solved again at the end of following, and trained from there on.
  while (trainer.iteration() < options.iterations / 8 + keys) trainer.step();
  const Motion before = *trainer.scene().main_motion;
  trainer.step();
  const Motion& after = *trainer.scene().main_motion;
  std::vector<int64_t> moved;
  for (int64_t key = 0; key < keys; ++key) {
    if (after.shift(0, key, 0) != before.shift(0, key, 0)) moved.push_back(key);
  }
  // One view of the step before, whose momentum lasts, and one of this one.
  EXPECT_GE(moved.size(), 5U);
  EXPECT_LE(moved.size(), 14U);
  EXPECT_EQ(std::count(moved.begin(), moved.end(), 0), 0);
}

// At the first time a body shifts across the picture, and its distance from the camera stays; at a later time
// the distance changes.
TEST(Tracker, KeepsBodiesAtTheirFirstDistance) {
  const Tumbling at;
  TrainOptions options = little_following();
  options.deform.track.steps = 8;
  Trainer trainer(options, at.capture, fs::path(::testing::TempDir()) / "first_distance");
  const auto keys = static_cast<int>(trainer.scene().main_motion->keys());
  const Motion before = *trainer.scene().main_motion;
  while (trainer.iteration() < options.iterations / 8 + keys) trainer.step();
  const Motion& after = *trainer.scene().main_motion;
  const auto changed = [&](int64_t key) {
    const auto camera = std::ranges::find(at.capture.train, after.time[key], &View::time)->camera;
    const Vec3<float> centre = load3<float>(before.centre.row(0));
    const float now = length(centre + load3<float>(&after.shift(0, key, 0)) - camera.position);
    return std::abs(now / length(centre - camera.position) - 1);
  };
  EXPECT_NE(after.shift(0, 0, 0), before.shift(0, 0, 0));
  EXPECT_LT(changed(0), 1e-3F);
  EXPECT_GT(changed(keys / 2), 2e-3F);
}

TEST(Tracker, ComesToTheSameBytesAtAnyThreadCount) {
  Tumbling at;
  const TrackOptions options;
  const Tracker tracker(options, Schedule(preset("cpu")).render(0), at.capture);
  std::set<std::vector<float>> found;
  for (const int threads : {1, 3}) {
    set_threads(threads);
    Motion motion = *at.scene.main_motion;
    Tracker::predict(motion, 1);
    tracker.solve(at.scene.main, nullptr, motion, 1, at.scene.extent, {3, options.blur}, {});
    found.insert({motion.rotation.values().begin(), motion.rotation.values().end()});
  }
  set_threads(0);
  EXPECT_EQ(found.size(), 1U);
}

// Masks that were found and that no body can show: after the first time, a bar at one side of the picture or
// the other.
Capture with_columns_found(const std::string& name) {
  const fs::path masked = with_masks(name, [](size_t k, Tensor<uint8_t>& mask) {
    if (k == 0) return;
    const int64_t area =
        std::count_if(mask.values().begin(), mask.values().end(), [](uint8_t m) { return m != 0; });
    const int64_t step = mask.size() / std::max<int64_t>(1, area);
    mask.fill(0);
    for (int64_t i = 0; i < mask.size(); ++i) mask[i] = i % mask.dim(1) % step == 0 ? 1 : 0;
  });
  Capture capture = load_capture(masked, {});
  capture.masks_are_found = true;
  return capture;
}

bool carries(const Trainer& trainer) {
  const Tensor<int32_t>& body = trainer.scene().main.body;
  return std::any_of(body.values().begin(), body.values().end(), [](int32_t b) { return b >= 0; });
}

TEST(Tracker, KeepsBodiesThatThePhotographsShow) {
  TrainOptions options = little_following();
  options.deform.track.map_each = 3;
  options.deform.track.true_poses = true;
  options.initial.max_points = options.density.max_surfels = 6000;
  Trainer trainer(options, with_columns_found("columns_kept"), fs::path(::testing::TempDir()) / "kept");
  std::string warning;
  trainer.stream().listen([&](const events::Event& event) {
    if (const auto* told = std::get_if<events::Warning>(&event)) warning = told->text;
  });
  while (trainer.iteration() < 92) trainer.step();
  EXPECT_TRUE(carries(trainer)) << warning;
}

TEST(Tracker, LetsBodiesGoThatNeitherMasksNorPhotographsShow) {
  const Capture capture = with_columns_found("column_masks");
  const TrainOptions options = little_following();
  const fs::path folder = fs::path(::testing::TempDir()) / ("let_go_" + std::to_string(::getpid()));
  Trainer trainer(options, capture, folder);
  std::string warning;
  trainer.stream().listen([&](const events::Event& event) {
    if (const auto* told = std::get_if<events::Warning>(&event)) warning = told->text;
  });
  while (carries(trainer) && trainer.iteration() < options.iterations) trainer.step();
  EXPECT_LT(trainer.iteration(), options.iterations);
  EXPECT_NE(warning.find("silhouettes"), std::string::npos) << warning;
  // What stands still is told from what moves, and the rest of the run goes on, also where it is resumed.
  const Tensor<int32_t>& body = trainer.scene().main.body;
  EXPECT_GT(std::count(body.values().begin(), body.values().end(), motionless), 100);
  trainer.save();
  Trainer resumed(options, capture, folder);
  resumed.resume();
  while (trainer.iteration() < options.iterations) {
    const double loss = trainer.step().total;
    EXPECT_TRUE(std::isfinite(loss));
    ASSERT_EQ(resumed.step().total, loss);
  }
}

// The middle of a body's light goes where the body goes, and nothing is brighter yet.
TEST(Bodies, TakeTheMiddleOfTheirLightAlong) {
  Tumbling at;
  Surfels& main = at.scene.main;
  Motion& motion = *at.scene.main_motion;
  main.opacity_logit.fill(1);
  Random random(3);
  for (float& v : motion.rotation.values()) v += 0.3F * static_cast<float>(random.normal());
  for (float& v : motion.shift.values()) v = 0.3F * static_cast<float>(random.normal());
  const Lighting lighting = lighting_around(motion, main, 8, 3, true);
  ASSERT_EQ(lighting.bodies(), motion.bodies());
  ASSERT_EQ(lighting.times(), (motion.keys() + 2) / 3);
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    double rest_radius = 0, count = 0;
    Vec3<double> rest(0);
    for (int64_t i = 0; i < main.count(); ++i) {
      if (main.body[i] != b) continue;
      rest += load3<double>(main.position.row(i));
      ++count;
    }
    rest /= count;
    for (int64_t i = 0; i < main.count(); ++i) {
      if (main.body[i] == b) rest_radius += std::pow(length(load3<double>(main.position.row(i)) - rest), 2);
    }
    EXPECT_NEAR(lighting.radius[b], std::sqrt(rest_radius / count), 1e-4);
    const Vec3<double> centre = load3<double>(motion.centre.row(b));
    for (int64_t k = 0; k < lighting.times(); ++k) {
      const Vec4<double> turn = unit_quaternion(load4<double>(&motion.rotation(b, 3 * k, 0)));
      const Vec3<double> now = rotation_from_quaternion(turn) * (rest - centre) + centre +
                               load3<double>(&motion.shift(b, 3 * k, 0));
      for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(lighting.centre(b, k, axis), now[axis], 1e-4);
    }
  }
  for (const float v : lighting.body_brightness.values()) EXPECT_EQ(v, 0);
  // Poses that are solved again take it along.
  for (int64_t i = 0; i < motion.shift.size(); i += 3) motion.shift[i] += 0.25F;
  Lighting after = lighting;
  carry_lighting(motion, main, after);
  for (int64_t i = 0; i < after.centre.size(); ++i)
    EXPECT_NEAR(after.centre[i], lighting.centre[i] + (i % 3 == 0 ? 0.25F : 0), 1e-5);
  EXPECT_EQ(lighting_around(motion, main, 8, 3, false).bodies(), 0);
}

TEST(Tracker, PredictsWhatGoesOnAsBefore) {
  Motion motion =
      still_motion(Tensor<float>({1, 3}), tensor_of(std::vector<float>{0, 0.1F, 0.2F, 0.3F, 0.4F, 1}));
  for (int64_t key = 1; key < 4; ++key) {
    const Vec4<double> q = quaternion_exp(Vec3<double>(0, 0.1 * static_cast<double>(key), 0));
    for (int k = 0; k < 4; ++k) motion.rotation(0, key, k) = static_cast<float>(q[k]);
    motion.shift(0, key, 1) = 0.5F * static_cast<float>(key);
  }
  Tracker::predict(motion, 4);
  EXPECT_NEAR(quaternion_log(load4<double>(&motion.rotation(0, 4, 0))).y, 0.4, 1e-6);
  EXPECT_NEAR(motion.shift(0, 4, 1), 2, 1e-6);
  EXPECT_EQ(motion.shift(0, 5, 1), motion.shift(0, 4, 1));
}

// A wall, and a square before it that the pictures miss: the square moves. What is hidden, in a mask or of a
// body does not vote; parts of the wall that the pictures miss too stand still, since the wall goes on around
// them.
TEST(Bodies, WhatThePicturesMissIsLeftToTheField) {
  constexpr int size = 80;
  View view;
  view.camera.width = view.camera.height = size;
  view.camera.focal_x = view.camera.focal_y = size;
  view.camera.centre_x = view.camera.centre_y = size / 2.0F;
  ViewImages images;
  images.colour.reset({size, size, 3});
  images.mask.reset({size, size});
  Tensor<float> colour({size, size, 3}), alpha({size, size}), depth({size, size});
  alpha.fill(1);
  depth.fill(2);
  for (int64_t y = 20; y < 40; ++y) {
    for (int64_t x = 20; x < 40; ++x) colour(y, x, 1) = 0.3F;
  }
  images.mask(30, 30) = 1;
  colour(60, 60, 1) = 1.5F;  // a few surfels of the wall
  for (int64_t y = 10; y < 30; ++y) {
    for (int64_t x = 50; x < 70; ++x) colour(y, x, 1) = 0.3F;  // a part of the wall, as in a shadow
  }
  // Two pixels between neighbours, a second wall behind the first, and a thing before it that the pictures
  // miss.
  constexpr int side = size / 2 - 1;
  Surfels wall;
  wall.position.reset({2 * side * side, 3});
  wall.body.reset({2 * side * side});
  wall.body.fill(moved_by_field);
  const auto pixel_of = [](int64_t i) { return 2 + 2 * (i % (side * side) % side); };
  const auto row_of = [](int64_t i) { return 2 + 2 * (i % (side * side) / side); };
  for (int64_t i = 0; i < wall.position.dim(0); ++i) {
    const bool in_square = pixel_of(i) >= 20 && pixel_of(i) < 40 && row_of(i) >= 20 && row_of(i) < 40;
    const float z = i >= side * side ? 3.0F : in_square ? 1.5F : 2.0F;
    store3(wall.position.row(i), z / size *
                                     Vec3<float>(static_cast<float>(pixel_of(i)) + 0.5F - size / 2.0F,
                                                 static_cast<float>(row_of(i)) + 0.5F - size / 2.0F, size));
  }
  wall.body[side * side - 1] = 0;
  Unrest unrest;
  unrest.look(wall, view, images, colour, alpha, depth);
  const int64_t still = mark_still(unrest, wall);
  EXPECT_EQ(wall.body[side * side - 1], 0);
  int64_t counted = 0;
  for (int64_t i = 0; i < wall.position.dim(0); ++i) {
    if (wall.body[i] == motionless) ++counted;
    const int64_t x = pixel_of(i), y = row_of(i);
    const bool inside = x > 21 && x < 38 && y > 21 && y < 38, outside = x < 18 || x > 41 || y < 18 || y > 41;
    const bool by_the_mask = std::abs(x - 30) < 2 && std::abs(y - 30) < 2;
    if (i >= side * side || outside || by_the_mask) {
      EXPECT_NE(wall.body[i], moved_by_field) << x << ' ' << y;
    } else if (inside) {
      EXPECT_EQ(wall.body[i], moved_by_field) << x << ' ' << y;
    }
  }
  EXPECT_EQ(still, counted);
}

// A body that is moved off the masks loses its surfels; one that stays in them keeps them.
TEST(Bodies, LoseSurfelsThatTheyTakeOutOfTheMasks) {
  Tumbling at;
  Surfels main = at.scene.main;
  const auto count_of = [&](int32_t body) {
    return std::count(main.body.data(), main.body.data() + main.count(), body);
  };
  const auto before = count_of(1);
  Motion motion = *at.scene.main_motion;
  for (int64_t key = 1; key < motion.keys(); ++key) motion.shift(0, key, 2) = 100;
  const int64_t released = release_strays(at.capture, motion, at.capture.train[1].time, main);
  EXPECT_EQ(released,
            std::count(main.body.data(), main.body.data() + main.count(), -1) -
                std::count(at.scene.main.body.data(), at.scene.main.body.data() + main.count(), -1));
  EXPECT_GT(static_cast<double>(count_of(1)), 0.8 * static_cast<double>(before));
}

}  // namespace
}  // namespace traceflow
