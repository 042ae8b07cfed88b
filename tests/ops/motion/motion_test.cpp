#include "ops/motion/motion.h"

#include <gtest/gtest.h>

#include <numbers>

#include "math/rotation_group.h"
#include "math/sh_rotation.h"
#include "motion_scene.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;

constexpr int64_t bodies = 3;

TEST(MotionReference, BackwardMatchesCentralDifferencesInEveryParameter) {
  for (const float time : times) {
    BasicMotion<double> motion = convert<double>(random_motion(2, 4));
    const Tensor<int32_t> body = bodies_in_turn(5, 2);
    BasicPosedSurfels<double> posed = convert<double>(random_posed(5, 3));
    const BasicPosedSurfels<double> weights = random_gradient_like(posed);
    const auto loss = [&] {
      BasicPosedSurfels<double> moved = posed;
      motion::forward_reference(motion, body, time, moved);
      return testing::dot(moved, weights);
    };
    BasicPosedSurfels<double> grad_posed = weights;
    BasicMotion<double> grad_motion = zeros_like<double>(motion);
    motion::backward_reference(motion, body, time, posed, grad_posed, grad_motion);
    expect_close(grad_motion.rotation, central_differences(motion.rotation, loss), 1e-7, "rotation");
    expect_close(grad_motion.shift, central_differences(motion.shift, loss), 1e-7, "shift");
    expect_close(grad_posed.position, central_differences(posed.position, loss), 1e-7, "position");
    expect_close(grad_posed.rotation, central_differences(posed.rotation, loss), 1e-7, "posed rotation");
    expect_close(grad_posed.sh, central_differences(posed.sh, loss), 1e-7, "sh");
  }
}

TEST(Motion, MatchesTheReference) {
  for (const int degree : {0, 1, 2, 3}) {
    for (const float time : times) {
      const Motion motion = random_motion(bodies, 5);
      const PosedSurfels posed = random_posed(3000, degree);
      const Tensor<int32_t> body = bodies_in_turn(3000, bodies);
      const MotionPass found = run_motion(Device::cpu, motion, body, time, posed);
      BasicPosedSurfels<double> moved = convert<double>(posed), grad = convert<double>(found.grad_moved);
      BasicMotion<double> grad_motion = zeros_like<double>(convert<double>(motion));
      motion::forward_reference(convert<double>(motion), body, time, moved);
      motion::backward_reference(convert<double>(motion), body, time, convert<double>(posed), grad,
                                 grad_motion);
      for (const auto& [a, b, name] :
           {std::tuple{&found.moved.position, &moved.position, "position"},
            {&found.moved.rotation, &moved.rotation, "rotation"},
            {&found.moved.sh, &moved.sh, "sh"},
            {&found.grad_posed.position, &grad.position, "by position"},
            {&found.grad_posed.rotation, &grad.rotation, "by rotation"},
            {&found.grad_posed.sh, &grad.sh, "by sh"},
            {&found.grad_motion.rotation, &grad_motion.rotation, "by body's rotation"},
            {&found.grad_motion.shift, &grad_motion.shift, "by shift"}}) {
        expect_close(*a, *b, 1e-5, name);
      }
      EXPECT_TRUE(same_bytes(found.moved.scale, posed.scale));
      EXPECT_TRUE(same_bytes(found.moved.opacity, posed.opacity));
      EXPECT_TRUE(same_bytes(found.grad_posed.tint, found.grad_moved.tint));
    }
  }
}

TEST(Motion, KeepsWhatASurfelLooksLikeFromASideOfItsBody) {
  const Motion motion = random_motion(1, 2);
  const PosedSurfels posed = random_posed(40, 3);
  Tensor<int32_t> body({40});
  const PosedSurfels moved = run_motion(Device::cpu, motion, body, 0.37F, posed).moved;
  const Mat3<float> before = rotation_from_quaternion(load4<float>(posed.rotation.row(0)));
  const Mat3<float> turn = rotation_from_quaternion(load4<float>(moved.rotation.row(0))) * transpose(before);
  Random random(3);
  for (int64_t i = 0; i < 40; ++i) {
    const auto d = normalize(Vec3<float>(random.normal(), random.normal(), random.normal()));
    const Vec3<float> was = sh_colour<float>(3, posed.sh.row(i), d);
    const Vec3<float> is = sh_colour<float>(3, moved.sh.row(i), turn * d);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(was[c], is[c], 1e-5);
    for (int64_t k = 0; k < i; ++k) {
      EXPECT_NEAR(length(load3<float>(moved.position.row(i)) - load3<float>(moved.position.row(k))),
                  length(load3<float>(posed.position.row(i)) - load3<float>(posed.position.row(k))), 1e-5);
    }
  }
}

TEST(Motion, TurnsEvenlyBetweenKeysAndStandsStillBeyondThem) {
  Motion motion = still_motion(Tensor<float>({1, 3}), tensor_of(std::vector<float>{0.2F, 0.6F}));
  const double quarter = std::numbers::pi / 2;
  const Vec4<double> q = quaternion_exp(Vec3<double>(0, 0, quarter));
  for (int k = 0; k < 4; ++k) motion.rotation(0, 1, k) = static_cast<float>(-3 * q[k]);
  motion.shift(0, 1, 2) = 4;
  Tensor<int32_t> body({1});
  const auto place_at = [&](float time) {
    Surfels one = random_surfels(1, true);
    store3(one.position.row(0), Vec3<float>(1, 0, 0));
    motion::move(motion, body, time, one);
    return load3<float>(one.position.row(0));
  };
  for (const auto& [time, share] :
       {std::pair{0.0F, 0.0}, {0.2F, 0.0}, {0.3F, 0.25}, {0.6F, 1.0}, {1.0F, 1.0}}) {
    const Vec3<float> x = place_at(time);
    EXPECT_NEAR(x.x, std::cos(share * quarter), 1e-6);
    EXPECT_NEAR(x.y, std::sin(share * quarter), 1e-6);
    EXPECT_NEAR(x.z, 4 * share, 1e-6);
  }
}

TEST(Motion, ASubsetIsASliceOfTheWholeAndOthersStayTheirBytes) {
  const Motion motion = random_motion(bodies, 3);
  const PosedSurfels posed = random_posed(60, 2);
  const Tensor<int32_t> body = bodies_in_turn(60, bodies);
  const MotionPass whole = run_motion(Device::cpu, motion, body, 0.5F, posed);
  const std::vector<int32_t> rows{1, 2, 8, 31, 59};
  PosedSurfels some = random_posed(5, 2);
  for (size_t k = 0; k < rows.size(); ++k) {
    const auto to = static_cast<int64_t>(k);
    std::copy_n(posed.position.row(rows[k]), 3, some.position.row(to));
  }
  const MotionPass part = run_motion(Device::cpu, motion, body, 0.5F, some, tensor_of(rows));
  for (size_t k = 0; k < rows.size(); ++k) {
    for (int c = 0; c < 3; ++c)
      EXPECT_EQ(part.moved.position(static_cast<int64_t>(k), c), whole.moved.position(rows[k], c));
  }
  for (int64_t i = 0; i < 60; i += bodies + 1) {
    for (int c = 0; c < 3; ++c) EXPECT_EQ(whole.moved.position(i, c), posed.position(i, c));
    for (int c = 0; c < 4; ++c) EXPECT_EQ(whole.grad_posed.rotation(i, c), whole.grad_moved.rotation(i, c));
  }
}

TEST(Motion, AFrozenOneGetsNoGradientAndABrokenSurfelGivesNone) {
  const Motion motion = random_motion(1, 3);
  PosedSurfels posed = random_posed(20, 1);
  Tensor<int32_t> body({20});
  EXPECT_TRUE(same_bytes(run_motion(Device::cpu, motion, body, 0.5F, posed, {}, true).grad_motion.shift,
                         Tensor<float>({1, 3, 3})));
  posed.position(4, 1) = std::numeric_limits<float>::quiet_NaN();
  posed.sh(6, 2, 0) = std::numeric_limits<float>::infinity();
  const MotionPass pass = run_motion(Device::cpu, motion, body, 0.5F, posed);
  EXPECT_TRUE(all_finite(pass.grad_motion.rotation));
  EXPECT_TRUE(all_finite(pass.grad_motion.shift));
}

TEST(Motion, HoldsTheFirstKeyAndNoOther) {
  Motion gradient = random_motion(2, 3);
  const Motion before = gradient;
  motion::hold_first_key(gradient);
  for (int64_t b = 0; b < 2; ++b) {
    for (int64_t key = 0; key < 3; ++key) {
      for (int k = 0; k < 3; ++k)
        EXPECT_EQ(gradient.shift(b, key, k), key == 0 ? 0 : before.shift(b, key, k));
      for (int k = 0; k < 4; ++k)
        EXPECT_EQ(gradient.rotation(b, key, k), key == 0 ? 0 : before.rotation(b, key, k));
    }
  }
}

TEST(Motion, HoldsTheOpacitiesOfWhatIsCarried) {
  Surfels gradient;
  gradient.opacity_logit = tensor_of(std::vector<float>{1, 2, 3, 4, 5});
  gradient.position.reset({5, 3});
  motion::hold_opacities(tensor_of(std::vector<int32_t>{0, -1, 1, -2, 1}), 4, gradient);
  const std::vector<float> held = {0, 2, 0, 4, 5};
  EXPECT_TRUE(std::ranges::equal(gradient.opacity_logit.values(), held));
}

TEST(Motion, SpreadsAGradientOverKeysAsAGaussian) {
  constexpr int64_t keys = 30, at = 11;
  constexpr float width = 2.5F;
  Motion motion = random_motion(2, keys);
  for (int64_t key = 0; key < keys; ++key) {
    for (int k = 0; k < 4; ++k)
      motion.rotation(1, key, k) = (key % 2 == 0 ? 1.0F : -1.0F) * static_cast<float>(k + 1);
  }
  Motion gradient = zeros_like<float>(motion);
  gradient.shift(0, at, 1) = 2;
  gradient.rotation(1, at, 3) = 5;
  motion::spread_over_keys(motion, width, gradient);
  for (int64_t key = 0; key < keys; ++key) {
    const double distance = static_cast<double>(key - at);
    const double share = std::abs(distance) > 7 ? 0 : std::exp(-distance * distance / (2.0 * width * width));
    EXPECT_NEAR(gradient.shift(0, key, 1), 2 * share, 1e-6);
    // Every second key holds the same rotation as the negative quaternion.
    EXPECT_NEAR(gradient.rotation(1, key, 3), (key % 2 == at % 2 ? 5 : -5) * share, 1e-6);
    EXPECT_EQ(gradient.shift(1, key, 1), 0);
    EXPECT_EQ(gradient.shift(0, key, 0), 0);
    EXPECT_EQ(gradient.rotation(0, key, 3), 0);
  }
}

TEST(Motion, ASpreadGradientGoesDownhill) {
  const Motion motion = random_motion(bodies, 25);
  const PosedSurfels posed = random_posed(50, 1);
  for (const float width : {0.2F, 1.0F, 4.0F}) {
    Motion gradient = run_motion(Device::cpu, motion, bodies_in_turn(50, bodies), 0.42F, posed).grad_motion;
    const Motion before = gradient;
    motion::spread_over_keys(motion, width, gradient);
    double along = 0;
    for (int64_t i = 0; i < before.shift.size(); ++i) along += double{before.shift[i]} * gradient.shift[i];
    for (int64_t i = 0; i < before.rotation.size(); ++i)
      along += double{before.rotation[i]} * gradient.rotation[i];
    EXPECT_GT(along, 0) << width;
  }
}

TEST(Motion, IsTheSameBytesAtAnyThreadCount) {
  const Motion motion = random_motion(bodies, 4);
  const PosedSurfels posed = random_posed(9000, 2);
  const Tensor<int32_t> body = bodies_in_turn(9000, bodies);
  expect_same_bytes_at_any_thread_count([&] {
    const MotionPass pass = run_motion(Device::cpu, motion, body, 0.42F, posed);
    return std::vector<Tensor<float>>{pass.moved.position, pass.moved.sh, pass.grad_posed.rotation,
                                      pass.grad_motion.rotation, pass.grad_motion.shift};
  });
}

TEST(RotationGroup, ExponentialAndLogarithmUndoEachOther) {
  Random random(1);
  for (int k = 0; k < 200; ++k) {
    const Vec3<double> v =
        (k < 50 ? 1e-5 : 1.7) * Vec3<double>(random.normal(), random.normal(), random.normal());
    if (length(v) > 3.1) continue;
    const Vec3<double> back = quaternion_log(quaternion_exp(v));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(back[c], v[c], 1e-9);
    const Vec3<double> x(random.normal(), random.normal(), random.normal());
    const Vec3<double> same = left_jacobian_inverse(v, left_jacobian(v, x));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(same[c], x[c], 1e-8);
    // exp(v + h x) = exp(h J(v) x) exp(v)
    constexpr double h = 1e-6;
    const Vec4<double> moved =
        quaternion_product(quaternion_exp(v + h * x), quaternion_conjugate(quaternion_exp(v)));
    const Vec3<double> rate = quaternion_log(moved) / h, expected = left_jacobian(v, x);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(rate[c], expected[c], 1e-4);
  }
}

}  // namespace
}  // namespace traceflow
