#include "train/training_state.h"

#include <gtest/gtest.h>

#include "math/rotation_group.h"
#include "support/file_bytes.h"
#include "track/prior_bias.h"
#include "train/checkpoint.h"
#include "train/tumbling.h"

namespace traceflow {
namespace {

std::string bytes_in(const TrainingState& state) {
  Safetensors file;
  put_state(state, file);
  const fs::path path = fs::path(::testing::TempDir()) / ("state_" + std::to_string(::getpid()));
  file.write(path);
  return bytes_of(path);
}

class TrainingStates : public ::testing::Test {
 protected:
  const Tumbling at;
  TrainingState state{preset("cpu"), at.capture, at.scene};

  // What an iteration draws and what it finds out about bodies.
  void draw() {
    state.views.draw(state.random);
    state.divergence.set_state({20, 30, 400});
    state.bodies.at_rest = state.bodies.released = true;
    state.bodies.texture_trust = TextureTrust::of(2);
    state.bodies.prior_bias = Mat3<double>(1);
  }
  void change_bodies() {
    Scene& scene = state.scene;
    scene.main.body.fill(moved_by_field);
    scene.main.opacity_logit.fill(0);
    scene.lighting = lighting_around(*scene.main_motion, scene.main, 4, 3, true);
    scene.main_motion->shift.fill(1);
    scene.main_motion = still_motion(Tensor<float>({1, 3}), scene.main_motion->time);
    state.optimiser.begin(*scene.main_motion);
  }
};

TEST_F(TrainingStates, AnIterationThatDoesNotEndIsRolledBack) {
  for (const bool solves_poses : {false, true}) {
    const std::string before = bytes_in(state);
    state.begin_iteration(solves_poses);
    draw();
    if (solves_poses) change_bodies();
    ASSERT_NE(bytes_in(state), before);
    state.roll_back();
    EXPECT_EQ(bytes_in(state), before);
    EXPECT_FALSE(state.bodies.released);
  }
}

TEST_F(TrainingStates, AnIterationThatEndedIsNotRolledBack) {
  state.begin_iteration(true);
  draw();
  change_bodies();
  state.end_iteration();
  EXPECT_EQ(state.iteration, 1);
  const std::string after = bytes_in(state);
  state.roll_back();
  EXPECT_EQ(bytes_in(state), after);
}

// Priors are corrected in the axes of cameras as refined so far.
TEST_F(TrainingStates, GivesViewsTheirCamerasAndTheCorrectionOfTheirPriors) {
  std::vector<View> views = at.capture.train;
  state.apply_to(views);
  EXPECT_FALSE(views[3].prior_turn);
  EXPECT_EQ(views[3].camera.position, at.capture.train[3].camera.position);
  CameraGradient<float> gradient{};
  gradient.camera_from_world[0][1] = 1;
  state.cameras.step(3, gradient, 0.1, 1, {});
  const Mat3<double> bias = rotation_from_quaternion(quaternion_exp(Vec3<double>(0.1, -0.1, 0)));
  state.bodies.prior_bias = bias;
  state.apply_to(views);
  EXPECT_NE(views[3].camera.camera_from_world, at.capture.train[3].camera.camera_from_world);
  EXPECT_EQ(views[3].camera.camera_from_world, state.cameras.camera(3).camera_from_world);
  EXPECT_EQ(*views[3].prior_turn, inverse_of_bias(views[3].camera, bias));
}

}  // namespace
}  // namespace traceflow
