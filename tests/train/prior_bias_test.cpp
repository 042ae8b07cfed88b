#include "track/prior_bias.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "files/safetensors.h"
#include "math/rotation.h"
#include "math/rotation_group.h"
#include "support/refusal.h"
#include "track/ball_body.h"
#include "track/tracker.h"
#include "train/small_run.h"
#include "train/trainer.h"
#include "train/tumbling.h"

namespace traceflow {
namespace {

Vec3<double> random_direction(Random& random) {
  return normalize(Vec3<double>(random.normal(), random.normal(), random.normal()));
}

Camera<float> turned_camera() {
  Camera<float> camera;
  camera.camera_from_world =
      Mat3<float>(rotation_from_quaternion(quaternion_exp(Vec3<double>(0.4, -1.1, 0.3))));
  return camera;
}

TEST(PriorBias, IsTheRotationOfMostPairs) {
  Random random(3);
  const Camera<float> camera = turned_camera();
  const Mat3<double> to_camera(camera.camera_from_world);
  const Vec3<double> turn(0.06, -0.1, 0.03);
  const Mat3<double> bias = rotation_from_quaternion(quaternion_exp(turn));
  PriorBias measured;
  for (int i = 0; i < 2000; ++i) {
    const Vec3<double> n = random_direction(random);
    const Vec3<double> told = transpose(to_camera) * bias * to_camera * n;
    // A quarter are of another surface.
    measured.add(camera, n, i % 4 == 0 ? random_direction(random) : 0.7 * told);
  }
  const std::optional<Mat3<double>> found = measured.rotation();
  ASSERT_TRUE(found);
  for (int c = 0; c < 3; ++c) EXPECT_LT(length((*found)[c] - bias[c]), 0.02);
  const Mat3<double> back(inverse_of_bias(camera, bias));
  for (int i = 0; i < 20; ++i) {
    const Vec3<double> n = random_direction(random);
    EXPECT_LT(length(back * (transpose(to_camera) * bias * to_camera * n) - n), 1e-5);
  }
}

TEST(PriorBias, IsNoneOfFewPairs) {
  Random random(4);
  PriorBias measured;
  for (int i = 0; i < 200; ++i) {
    const Vec3<double> n = random_direction(random);
    measured.add(turned_camera(), n, i < 49 ? n : 0.4 * n);
  }
  EXPECT_FALSE(measured.rotation());
}

// Surroundings that are turned the other way do not undo what is known of the mask.
TEST(PriorBias, OnceKnownIsNotTakenFromTheSurroundingsAgain) {
  Surfels surfels = ball_body::ball();
  TrackTarget target = ball_body::picture_of(surfels, Vec3<double>(0), false);
  const Mat3<float> turn(rotation_from_quaternion(quaternion_exp(Vec3<double>(0, 0.1, 0))));
  for (int64_t i = 0; i < target.normal_prior.size(); i += 3)
    store3(&target.normal_prior[i], turn * load3<float>(&target.normal_prior[i]));
  target.mask.fill(0);
  for (const bool is_known : {false, true}) {
    target.prior_is_unbiased = is_known;
    Motion motion = ball_body::turned_by(Vec3<double>(0));
    PoseSolver solver(surfels, nullptr, motion, 0, {}, {target});
    solver.turn_priors();
    const Tensor<float>& after = solver.targets()[0].normal_prior;
    double turned = 0;
    for (int64_t i = 0; i < after.size(); ++i)
      turned = std::max(turned, std::abs(static_cast<double>(after[i]) - target.normal_prior[i]));
    EXPECT_NEAR(turned, is_known ? 0 : 0.1, 0.02) << is_known;
  }
}

// The surroundings' priors are off too: they turn those of a view of which nothing is known.
TEST(PriorBias, OfAViewKeepsTheTrackerFromTheSurroundings) {
  Tumbling at;
  const TrainOptions options = preset("cpu");
  std::vector<Motion> solved;
  for (const bool is_known : {false, true}) {
    if (is_known) {
      for (View& view : at.capture.train) view.prior_turn = Mat3<float>(1);
    }
    solved.push_back(*at.scene.main_motion);
    Tracker(options.deform.track, Schedule(options).render(0), at.capture)
        .solve(at.scene.main, nullptr, solved.back(), 0, at.scene.extent, {4, 1}, {});
  }
  double turned = 0;
  for (int64_t b = 0; b < solved[0].bodies(); ++b) {
    const auto turn = [&](const Motion& motion) {
      return quaternion_log(unit_quaternion(load4<double>(&motion.rotation(b, 0, 0))));
    };
    turned = std::max(turned, length(turn(solved[0]) - turn(solved[1])));
  }
  EXPECT_GT(turned, 0.01);
}

// Where a run in which priors on mirrors count more parts from one in which they do not.
TEST(PriorBias, PriorsOnMirrorsCountMoreOnceBodiesAreFollowedOrStand) {
  const Tumbling at;
  TrainOptions options = preset("cpu");
  options.iterations = 120;
  options.initial.max_points = options.density.max_surfels = 2000;
  options.initial.environment_points = 500;
  options.deform.track.map_each = 1;
  const int warm_up = options.iterations / 8, times = static_cast<int>(at.capture.train.size());
  options.deform.track.still = 10;
  const auto parting = [&](bool stands, Specular specular) {
    options.specular = specular;
    options.deform.track.true_poses = !stands;
    options.loss.normal_prior_on_mirrors = 1;
    Trainer even(options, at.capture, fs::path(::testing::TempDir()) / "even");
    options.loss.normal_prior_on_mirrors = 7;
    Trainer more(options, at.capture, fs::path(::testing::TempDir()) / "more");
    LossValues a, b;
    while (a["normal_prior"] == b["normal_prior"] && even.iteration() < options.iterations / 2) {
      a = even.step();
      b = more.step();
    }
    EXPECT_EQ(a["l1"], b["l1"]);
    EXPECT_GE(b["normal_prior"], a["normal_prior"]);
    return a["normal_prior"] == b["normal_prior"] ? std::nullopt : std::optional(even.iteration() - 1);
  };
  EXPECT_EQ(parting(false, Specular::environment_gaussians), warm_up + times - 1);
  EXPECT_EQ(parting(true, Specular::environment_gaussians), warm_up);
  EXPECT_EQ(parting(true, Specular::none), std::nullopt);
}

// A tracker that knows the bias follows otherwise, so the step that measures it must not know it the second
// time. The photographs vanish in that very step.
TEST(PriorBias, ThatIsMeasuredInAFailedStepIsMeasuredAgain) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("bias_fleeting_" + std::to_string(::getpid()));
  const fs::path gone = folder.string() + "_gone", run = folder.string() + "_run";
  SynthOptions made;
  made.scene = SynthScene::tumble;
  made.frames = 5;
  made.width = 64;
  made.height = 36;
  made.samples = 1;
  made.points = 1000;
  write_synthetic_capture(made, folder);
  TrainOptions options = preset("cpu");
  options.iterations = 80;
  options.specular = Specular::none;
  options.initial.max_points = options.density.max_surfels = made.points;
  options.capture.cache_mebibytes = 0;
  options.deform.bend.nodes = 0;
  options.deform.track.rounds = 2;
  options.deform.track.map_each = 1;
  options.deform.track.steps = options.deform.track.again = 1;
  int measured = -1;
  {
    Trainer trainer(options, load_capture(folder, options.capture), run);
    trainer.stream().listen([&](const events::Event& event) {
      if (!std::holds_alternative<events::PriorsTurned>(event)) return;
      measured = trainer.iteration();
      fs::rename(folder, gone);
    });
    EXPECT_EQ(trainer.run(std::atomic<bool>(false)).ending, events::Ending::no_input);
    ASSERT_GT(measured, 0);
    EXPECT_EQ(trainer.iteration(), measured);
  }
  fs::rename(gone, folder);
  Trainer resumed(options, load_capture(folder, options.capture), run);
  resumed.resume();
  Trainer whole(options, load_capture(folder, options.capture), folder.string() + "_whole");
  for (Trainer* trainer : {&resumed, &whole}) {
    while (trainer->iteration() < measured + 2) trainer->step();
    EXPECT_TRUE(trainer->capture().train.front().prior_turn);
  }
  EXPECT_EQ(scene_bytes(resumed.scene()), scene_bytes(whole.scene()));
}

// Priors of things that are turned by 8 degrees are turned back when the film has been followed, in a run
// that goes on from its checkpoint too.
TEST(PriorBias, OfMasksIsTurnedBackInTraining) {
  const Mat3<double> bias = rotation_from_quaternion(quaternion_exp(Vec3<double>(0.1, -0.1, 0)));
  const fs::path folder = fs::path(::testing::TempDir()) / ("prior_bias_" + std::to_string(::getpid()));
  SynthOptions made;
  made.scene = SynthScene::tumble;
  made.frames = 9;
  made.width = 96;
  made.height = 54;
  made.samples = 1;
  made.points = 2000;
  made.prior_noise = 0;
  write_synthetic_capture(made, folder);
  Capture capture = load_capture(folder, {});
  for (View& view : capture.train) view.prior_turn = inverse_of_bias(view.camera, transpose(bias));
  TrainOptions options = preset("cpu");
  options.iterations = 200;
  options.specular = Specular::none;
  options.initial.max_points = options.density.max_surfels = made.points;
  options.deform.track.rounds = 2;
  options.deform.track.map_each = 1;
  options.deform.track.true_poses = true;
  const auto expect_turned = [&](const Trainer& trainer) {
    for (const View& view : trainer.capture().train) {
      ASSERT_TRUE(view.prior_turn);
      const Mat3<float> expected = inverse_of_bias(view.camera, bias);
      for (int c = 0; c < 3; ++c) EXPECT_LT(length((*view.prior_turn)[c] - expected[c]), 0.06);
    }
  };
  for (const bool turns : {false, true}) {
    options.deform.track.prior_turn = turns;
    options.rates.camera = turns ? 1e-4F : 0;
    Trainer trainer(options, capture, folder / "run");
    std::vector<double> told;
    trainer.stream().listen([&](const events::Event& event) {
      if (const auto* e = std::get_if<events::PriorsTurned>(&event)) told.push_back(e->degrees);
    });
    const Mat3<float> given = *capture.train.back().prior_turn;
    while (trainer.iteration() <= options.iterations / 2) trainer.step();
    if (!turns) {
      EXPECT_TRUE(told.empty());
      EXPECT_EQ(*trainer.capture().train.back().prior_turn, given);
      continue;
    }
    expect_turned(trainer);
    ASSERT_EQ(told.size(), 1U);
    EXPECT_NEAR(told[0], 8.1, 3);
    for (int i = 0; i < 3; ++i) trainer.step();
    trainer.save();
    Trainer resumed(options, load_capture(folder, {}), folder / "run");
    resumed.resume();
    expect_turned(resumed);
    for (size_t i = 0; i < capture.train.size(); ++i)
      EXPECT_EQ(*resumed.capture().train[i].prior_turn, *trainer.capture().train[i].prior_turn);

    const fs::path checkpoint = RunFolder{folder / "run"}.checkpoint();
    for (const Tensor<double>& wrong : {Tensor<double>({3, 3}), Tensor<double>({9})}) {
      Safetensors file = Safetensors::read(checkpoint);
      file.add("prior_bias", wrong);
      file.write(checkpoint);
      EXPECT_THAT(refusal_of([&] { Trainer(options, load_capture(folder, {}), folder / "run").resume(); }),
                  ::testing::HasSubstr("prior_bias"));
    }
  }
}

}  // namespace
}  // namespace traceflow
