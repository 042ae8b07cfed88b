#include "train/density.h"

#include <gtest/gtest.h>

#include <cmath>

#include "math/activation.h"

namespace traceflow {
namespace {

constexpr SceneSize size{.extent = 1, .cloud = 1};

// Surfels of one size and opacity in a row, with moments that are not zero.
struct Set {
  Surfels surfels;
  SurfelMoments moments;

  Set(int64_t count, float scale, float opacity) {
    surfels.position.reset({count, 3});
    surfels.log_scale.reset({count, 2});
    surfels.log_scale.fill(std::log(scale));
    surfels.rotation.reset({count, 4});
    surfels.opacity_logit.reset({count});
    surfels.opacity_logit.fill(std::log(opacity / (1 - opacity)));
    surfels.sh.reset({count, 4, 3});
    surfels.tint_logit.reset({count});
    for (int64_t i = 0; i < count; ++i) {
      surfels.position(i, 0) = static_cast<float>(i);
      surfels.rotation(i, 0) = 1;
      surfels.tint_logit[i] = static_cast<float>(i);
    }
    moments.reset_like(surfels);
    moments.for_each([](const std::string&, optimize::AdamState& state) {
      state.first.fill(1);
      state.second.fill(2);
    });
  }
};

DensityOptions options() {
  DensityOptions o;
  o.gradient_threshold = 1;
  o.clone_below = 0.01F;
  return o;
}

// Signals every surfel once; `strong` ones above the threshold.
void signal(DensityControl& control, int64_t count, const std::vector<int64_t>& strong) {
  Tensor<float> value(Shape{count});
  Tensor<uint8_t> touched(Shape{count});
  touched.fill(1);
  value.fill(0.1F);
  for (const int64_t i : strong) value[i] = 5.0F + static_cast<float>(i);
  control.accumulate(value, touched);
}

TEST(Density, ClonesSmallSurfelsWithAStrongSignal) {
  Set set(10, 0.001F, 0.5F);
  DensityControl control("main", options(), 10);
  signal(control, 10, {3, 7});
  Random random(1);
  const events::DensityChanged change = control.update(set.surfels, set.moments, {size, 1000}, random);
  EXPECT_EQ(change.cloned, 2);
  EXPECT_EQ(change.split, 0);
  EXPECT_EQ(set.surfels.count(), 12);
  EXPECT_EQ(set.surfels.position(10, 0), 3);
  EXPECT_EQ(set.surfels.position(11, 0), 7);
  EXPECT_EQ(set.surfels.tint_logit[11], 7);
}

TEST(Density, ACloneAndItsOriginalCoverWhatTheOriginalDid) {
  Set set(4, 0.001F, 0.5F);
  set.surfels.opacity_logit[1] = logit(0.9F);
  set.surfels.opacity_logit[2] = logit(0.06F);
  DensityOptions o = options();
  o.clones_share_opacity = true;
  DensityControl control("main", o, 4);
  signal(control, 4, {1, 2});
  Random random(1);
  ASSERT_EQ(control.update(set.surfels, set.moments, {size, 1000}, random).cloned, 2);
  const auto opacity = [&](int64_t i) { return sigmoid(double{set.surfels.opacity_logit[i]}); };
  EXPECT_NEAR(1 - (1 - opacity(1)) * (1 - opacity(4)), 0.9, 1e-5);
  EXPECT_EQ(opacity(1), opacity(4));
  for (const int64_t i : {2, 5}) EXPECT_NEAR(opacity(i), o.prune_opacity, 1e-5) << "else it would be pruned";
  for (const int64_t i : {0, 3}) EXPECT_NEAR(opacity(i), 0.5, 1e-5) << i;
}

TEST(Density, PrunesWhatIsWideForTheCamerasOrForTheCloud) {
  for (const SceneSize& small : {SceneSize{0.1F, 1}, SceneSize{1, 0.1F}}) {
    Set set(5, 0.05F, 0.5F);
    DensityOptions o = options();
    o.prune_above = o.prune_above_cloud = 0.4F;
    DensityControl control("main", o, 5);
    signal(control, 5, {});
    set.surfels.log_scale(3, 1) = set.surfels.log_scale(1, 0) = std::log(0.02F);
    set.surfels.log_scale(1, 1) = std::log(0.02F);
    Random random(1);
    EXPECT_EQ(control.update(set.surfels, set.moments, {small, 1000}, random).pruned_large, 4);
  }
}

TEST(Density, ShortensOnlyNeedlesAndKeepsTheirWidth) {
  constexpr int64_t count = 500;
  constexpr float cloud = 2;
  Set set(count, 1, 0.5F);
  DensityOptions o = options();
  o.longest_needle = 0.1F;
  Random random(3);
  for (float& scale : set.surfels.log_scale.values()) scale = static_cast<float>(-3 + 1.5 * random.normal());
  const Tensor<float> before = set.surfels.log_scale;
  DensityControl("main", o, count).shorten_needles(set.surfels, cloud);
  int64_t shortened = 0;
  for (int64_t i = 0; i < count; ++i) {
    const int64_t wide = before(i, 0) < before(i, 1) ? 0 : 1;
    EXPECT_EQ(set.surfels.log_scale(i, wide), before(i, wide));
    const double width = std::exp(before(i, wide)), length = std::exp(before(i, 1 - wide));
    const double expected = std::min(length, std::max(10 * width, 0.1 * cloud));
    EXPECT_NEAR(std::exp(set.surfels.log_scale(i, 1 - wide)), expected, 1e-5 * expected);
    if (expected < length) {
      ++shortened;
    } else {
      EXPECT_EQ(set.surfels.log_scale(i, 1 - wide), before(i, 1 - wide));
    }
  }
  EXPECT_GT(shortened, 20);
  EXPECT_LT(shortened, count / 2);
}

// One camera at the origin that looks along z, 90° wide and high.
Tensor<Camera<float>> one_camera() {
  Tensor<Camera<float>> cameras({1});
  cameras[0] = {.width = 100, .height = 100, .focal_x = 50, .focal_y = 50, .centre_x = 50, .centre_y = 50};
  return cameras;
}

// A surfel with its long axis along `axis` (0: x, 1: y, 2: z), in front of one_camera().
Set surfel_along(int axis, const Vec3<float>& centre, float length) {
  const float half = std::sqrt(0.5F);
  const Vec4<float> rotations[] = {{1, 0, 0, 0}, {half, 0, 0, half}, {half, 0, -half, 0}};
  Set set(1, 0.001F, 0.5F);
  set.surfels.log_scale[0] = std::log(length);
  for (int k = 0; k < 3; ++k) set.surfels.position[k] = centre[k];
  for (int k = 0; k < 4; ++k) set.surfels.rotation[k] = rotations[axis][k];
  return set;
}

float length_after_shortening(Set set, float limit, float cloud = 2) {
  DensityOptions o = options();
  o.longest_unseen = limit;
  DensityControl("main", o, 1).shorten_unseen(set.surfels, one_camera(), cloud);
  return std::exp(set.surfels.log_scale[0]);
}

TEST(Density, ShortensWhatExtendsUnseenTowardsTheCameras) {
  // Along z at y = 1.45: seen where z > 1.45. In twelfths of its half length, 3, the last point that is seen
  // is 0.5 before the centre.
  const Vec3<float> centre(0, 1.45F, 2);
  EXPECT_NEAR(length_after_shortening(surfel_along(2, centre, 1), 0.1F), (0.5 + 0.2) / 3, 1e-5);
  EXPECT_NEAR(length_after_shortening(surfel_along(2, centre, 1), 0.5F), (0.5 + 1) / 3, 1e-5);
  // No limit, or one beyond its end.
  EXPECT_EQ(length_after_shortening(surfel_along(2, centre, 1), 0), 1);
  EXPECT_EQ(length_after_shortening(surfel_along(2, centre, 1), 1.4F), 1);
  // All points of the capture coincide.
  EXPECT_EQ(length_after_shortening(surfel_along(2, centre, 1), 0.1F, 0), 1);
}

TEST(Density, LeavesWhatIsSeenOrNoNearerThanItsCentre) {
  // Seen as a whole.
  EXPECT_FLOAT_EQ(length_after_shortening(surfel_along(2, {0, 0, 5}, 1), 0.1F), 1);
  EXPECT_FLOAT_EQ(length_after_shortening(surfel_along(0, {0, 0, 5}, 1), 0.1F), 1);
  // It leaves the image sideways, on both sides, and its ends are farther away.
  EXPECT_FLOAT_EQ(length_after_shortening(surfel_along(0, {0, 0, 2}, 1), 0.1F), 1);
  // It belongs to a body, which moves.
  Set moving = surfel_along(2, {0, 1.5F, 2}, 1);
  moving.surfels.body.reset({1});
  EXPECT_FLOAT_EQ(length_after_shortening(moving, 0.1F), 1);
  moving.surfels.body[0] = motionless;
  EXPECT_LT(length_after_shortening(moving, 0.1F), 0.3F);
}

TEST(Density, ShorteningUnseenPartsNeverLengthensAndLeavesTheWidth) {
  constexpr int64_t count = 300;
  Set set(count, 1, 0.5F);
  Random random(8);
  for (float& x : set.surfels.position.values()) x = static_cast<float>(2 * random.normal());
  for (float& x : set.surfels.rotation.values()) x = static_cast<float>(random.normal());
  for (float& scale : set.surfels.log_scale.values()) scale = static_cast<float>(-1 + random.normal());
  const Tensor<float> before = set.surfels.log_scale;
  DensityOptions o = options();
  o.longest_unseen = 0.1F;
  DensityControl("main", o, count).shorten_unseen(set.surfels, one_camera(), 1);
  int64_t shortened = 0;
  for (int64_t k = 0; k < before.size(); ++k) {
    EXPECT_LE(set.surfels.log_scale[k], before[k]);
    EXPECT_GE(std::exp(set.surfels.log_scale[k]), std::min(std::exp(before[k]), 0.1F / 3) * 0.999F);
    shortened += set.surfels.log_scale[k] < before[k] ? 1 : 0;
  }
  EXPECT_GT(shortened, 20);
  EXPECT_LT(shortened, count);
}

TEST(Density, PrunesTheWideOnlyWhenItIsTold) {
  Set set(5, 0.5F, 0.5F);
  DensityControl control("main", options(), 5);
  set.surfels.log_scale(3, 0) = set.surfels.log_scale(3, 1) = std::log(0.02F);
  Random random(1);
  EXPECT_EQ(control.update(set.surfels, set.moments, {size, 1000, false}, random).pruned_large, 0);
  EXPECT_EQ(control.update(set.surfels, set.moments, {size, 1000, true}, random).pruned_large, 4);
}

TEST(Density, LeavesTheFaintAloneWhileTheyRecover) {
  Set set(3, 0.02F, 0.01F);
  set.surfels.opacity_logit[1] = 2;
  set.surfels.opacity_logit[2] = std::nanf("");
  DensityControl control("main", options(), 3);
  Random random(1);
  EXPECT_EQ(control.update(set.surfels, set.moments, {size, 100, true, false}, random).pruned_transparent, 1);
  EXPECT_EQ(control.update(set.surfels, set.moments, {size, 100}, random).pruned_transparent, 1);
  EXPECT_EQ(set.surfels.count(), 1);
}

TEST(Density, SplitsLargeSurfelsIntoTwoSmallerOnesInTheirPlane) {
  Set set(5, 0.05F, 0.5F);
  DensityControl control("main", options(), 5);
  signal(control, 5, {2});
  Random random(1);
  const events::DensityChanged change = control.update(set.surfels, set.moments, {size, 1000}, random);
  EXPECT_EQ(change.split, 1);
  ASSERT_EQ(set.surfels.count(), 6);
  for (const int64_t child : {4, 5}) {
    EXPECT_NEAR(set.surfels.log_scale(child, 0), std::log(0.05F / 1.6F), 1e-5F);
    EXPECT_EQ(set.surfels.position(child, 2), 0) << "the identity frame's plane is z = 0";
    EXPECT_NE(set.surfels.position(child, 0), 2);
  }
  for (int64_t i = 0; i < 4; ++i) EXPECT_NE(set.surfels.position(i, 0), 2) << "the parent is gone";
}

TEST(Density, NewSurfelsHaveZeroMomentsAndOldOnesKeepTheirs) {
  Set set(4, 0.001F, 0.5F);
  DensityControl control("main", options(), 4);
  signal(control, 4, {0});
  Random random(1);
  control.update(set.surfels, set.moments, {size, 1000}, random);
  set.moments.for_each([](const std::string& name, optimize::AdamState& state) {
    const int64_t row = state.first.row_size();
    for (int64_t k = 0; k < row; ++k) {
      EXPECT_EQ(state.first[3 * row + k], 1) << name;
      EXPECT_EQ(state.first[4 * row + k], 0) << name;
      EXPECT_EQ(state.second[4 * row + k], 0) << name;
    }
  });
}

TEST(Density, SurfelsThatAreAddedBeginAnewBehindTheOthers) {
  Set set(3, 0.001F, 0.5F);
  DensityControl control("main", options(), 3);
  signal(control, 3, {1});
  const events::DensityChanged change = control.add(set.surfels, set.moments, Set(2, 0.002F, 0.9F).surfels);
  EXPECT_EQ(change.added, 2);
  EXPECT_EQ(change.count, 5);
  ASSERT_EQ(set.surfels.count(), 5);
  EXPECT_EQ(set.surfels.position(2, 0), 2);
  EXPECT_EQ(set.surfels.position(4, 0), 1);
  EXPECT_EQ(set.surfels.log_scale(3, 0), std::log(0.002F));
  EXPECT_EQ(set.moments.position.first(2, 0), 1);
  EXPECT_EQ(set.moments.position.first(3, 0), 0);
  EXPECT_EQ(set.moments.position.second(4, 0), 0);
  // What was learnt of the others still counts.
  Random random(1);
  EXPECT_EQ(control.update(set.surfels, set.moments, {size, 1000}, random).cloned, 1);
}

TEST(Density, PrunesTheFaintTheOversizedAndTheBroken) {
  Set set(6, 0.02F, 0.5F);
  set.surfels.opacity_logit[1] = -10;
  set.surfels.log_scale(2, 1) = std::log(0.5F);
  set.surfels.opacity_logit[3] = std::nanf("");
  DensityControl control("main", options(), 6);
  Random random(1);
  const events::DensityChanged change = control.update(set.surfels, set.moments, {size, 1000}, random);
  EXPECT_EQ(change.pruned_transparent, 2);
  EXPECT_EQ(change.pruned_large, 1);
  ASSERT_EQ(set.surfels.count(), 3);
  EXPECT_EQ(set.surfels.position(0, 0), 0);
  EXPECT_EQ(set.surfels.position(1, 0), 4);
  EXPECT_EQ(set.surfels.position(2, 0), 5);
}

TEST(Density, TheCapHoldsAndTheStrongestSignalsGoFirst) {
  Set set(10, 0.001F, 0.5F);
  DensityControl control("main", options(), 10);
  signal(control, 10, {1, 2, 3, 4, 5});
  Random random(1);
  const events::DensityChanged change = control.update(set.surfels, set.moments, {size, 12}, random);
  EXPECT_TRUE(change.at_cap);
  EXPECT_EQ(change.cloned, 2);
  ASSERT_EQ(set.surfels.count(), 12);
  EXPECT_EQ(set.surfels.position(10, 0) + set.surfels.position(11, 0), 4 + 5);
}

TEST(Density, NeverEmptiesASet) {
  Set set(3, 0.02F, 0.001F);
  DensityControl control("main", options(), 3);
  Random random(1);
  control.update(set.surfels, set.moments, {size, 100}, random);
  EXPECT_EQ(set.surfels.count(), 3);
}

TEST(Density, SignalsThatWereNotTouchedOrNotFiniteDoNotCount) {
  Set set(2, 0.001F, 0.5F);
  DensityControl control("main", options(), 2);
  Tensor<float> value(Shape{2});
  Tensor<uint8_t> touched(Shape{2});
  value[0] = 100;
  value[1] = std::nanf("");
  touched[1] = 1;
  control.accumulate(value, touched);
  Random random(1);
  EXPECT_EQ(control.update(set.surfels, set.moments, {size, 100}, random).cloned, 0);
}

TEST(Density, OpacityResetLowersTheLogitAndForgetsItsMoments) {
  Set set(2, 0.001F, 0.9F);
  set.surfels.opacity_logit[1] = -8;
  const DensityControl control("main", options(), 2);
  control.reset_opacity(set.surfels, set.moments);
  EXPECT_NEAR(1 / (1 + std::exp(-set.surfels.opacity_logit[0])), 0.01F, 1e-6F);
  EXPECT_EQ(set.surfels.opacity_logit[1], -8);
  EXPECT_EQ(set.moments.opacity_logit.first[0], 0);
  EXPECT_EQ(set.moments.position.first[0], 1);
}

}  // namespace
}  // namespace traceflow
