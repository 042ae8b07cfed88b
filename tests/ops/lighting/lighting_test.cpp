#include "ops/lighting/lighting.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "lighting_scene.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;

TEST(Lighting, MatchesTheReference) {
  for (const float time : times) {
    for (const int degree : {0, 2}) {
      const Lighting lighting = random_lighting(4, degree);
      const PosedSurfels posed = random_posed(500, degree);
      const Tensor<int32_t> body = bodies_in_turn(500, 2);
      const LightingPass found = run_lighting(Device::cpu, lighting, body, time, posed);
      BasicPosedSurfels<double> lit = convert<double>(posed);
      lighting::forward_reference(convert<double>(lighting), body, time, lit);
      expect_close(found.lit.sh, lit.sh, 1e-5, "sh");
      for (int64_t i = 0; i < posed.count(); ++i) {
        const bool keeps = std::equal(found.lit.sh.row(i), found.lit.sh.row(i + 1), posed.sh.row(i));
        if (body[i] >= 0) {
          EXPECT_EQ(keeps, lighting.bodies() == 0) << i;
        }
      }
      EXPECT_FALSE(same_bytes(found.lit.sh, posed.sh));
      EXPECT_TRUE(same_bytes(found.lit.position, posed.position));
    }
  }
}

TEST(Lighting, BackwardMatchesCentralDifferencesOfTheReference) {
  for (const float time : times) {
    const Lighting lighting = random_lighting(3, 2);
    const PosedSurfels posed = random_posed(24, 1);
    const Tensor<int32_t> body = bodies_in_turn(24, 2);
    const LightingPass found = run_lighting(Device::cpu, lighting, body, time, posed);
    BasicLighting<double> exact = convert<double>(lighting);
    BasicPosedSurfels<double> at = convert<double>(posed);
    const BasicPosedSurfels<double> weights = convert<double>(found.grad_lit);
    const auto loss = [&] {
      BasicPosedSurfels<double> lit = at;
      lighting::forward_reference(exact, body, time, lit);
      return testing::dot(lit, weights);
    };
    expect_close(found.grad_lighting.brightness, central_differences(exact.brightness, loss), 2e-5,
                 "brightness");
    expect_close(found.grad_lighting.body_brightness, central_differences(exact.body_brightness, loss), 2e-5,
                 "brightness of bodies");
    expect_close(found.grad_posed.sh, central_differences(at.sh, loss), 2e-5, "sh");
    expect_close(found.grad_posed.position, central_differences(at.position, loss), 2e-5, "position");
  }
}

// Points on the box's faces are held, so that light changes nowhere at once.
TEST(Lighting, ResistanceMatchesCentralDifferencesOfTheReferenceWithinTheFaces) {
  const Lighting lighting = random_lighting(4, 2);
  for (const lighting::Stiffness& weights :
       {lighting::Stiffness{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.3, 0.2, 0.1}}) {
    BasicLighting<double> exact = convert<double>(lighting);
    Lighting gradient = zeros_like<float>(lighting);
    gradient.brightness.fill(0.5F);
    gradient.body_brightness.fill(0.5F);
    lighting::resist(lighting, weights, gradient);
    Tensor<double> expected =
        central_differences(exact.brightness, [&] { return lighting::resist_reference(exact, weights); });
    for (int64_t i = 0; i < expected.size(); ++i) {
      const int64_t x = i % 6, y = i / 6 % 5, z = i / 30 % 4;
      const bool is_on_a_face = x == 0 || y == 0 || z == 0 || x == 5 || y == 4 || z == 3;
      expected[i] = is_on_a_face ? 0 : expected[i] + 0.5;
    }
    expect_close(gradient.brightness, expected, 1e-5, "brightness");
    expected = central_differences(exact.body_brightness,
                                   [&] { return lighting::resist_reference(exact, weights); });
    for (double& v : expected.values()) v += 0.5;
    expect_close(gradient.body_brightness, expected, 1e-5, "brightness of bodies");
  }
}

TEST(Lighting, OfASubsetIsThatOfItsSurfels) {
  const Lighting lighting = random_lighting(3, 2);
  const PosedSurfels posed = random_posed(60, 1);
  const Tensor<int32_t> body = bodies_in_turn(120, 2);
  Tensor<int32_t> subset({60}), body_of_subset({60});
  for (int64_t i = 0; i < 60; ++i) {
    subset[i] = static_cast<int32_t>(2 * i + (i % 3 == 0 ? 1 : 0));
    body_of_subset[i] = body[subset[i]];
  }
  const LightingPass all = run_lighting(Device::cpu, lighting, body_of_subset, 0.42F, posed);
  const LightingPass some = run_lighting(Device::cpu, lighting, body, 0.42F, posed, subset);
  EXPECT_TRUE(same_bytes(some.lit.sh, all.lit.sh));
  EXPECT_TRUE(same_bytes(some.grad_lighting.brightness, all.grad_lighting.brightness));
  EXPECT_TRUE(same_bytes(some.grad_lighting.body_brightness, all.grad_lighting.body_brightness));
}

// What is stored is lit as what is drawn.
TEST(Lighting, OfStoredSurfelsIsThatOfPosedOnes) {
  const Lighting lighting = random_lighting(3, 1);
  const PosedSurfels posed = random_posed(100, 2);
  const Tensor<int32_t> body = bodies_in_turn(100, 1);
  Surfels stored;
  stored.position = posed.position;
  stored.sh = posed.sh;
  lighting::light(lighting, body, 0.42F, stored);
  EXPECT_TRUE(same_bytes(stored.sh, run_lighting(Device::cpu, lighting, body, 0.42F, posed).lit.sh));
}

TEST(Lighting, ABrokenSurfelGivesNothing) {
  PosedSurfels posed = random_posed(20, 1);
  posed.position.fill(0);
  for (const int64_t i : {4, 7}) {  // of none, and of a body
    posed.position(i, 1) = std::numeric_limits<float>::quiet_NaN();
    posed.sh(i + 2, 0, 0) = std::numeric_limits<float>::infinity();
  }
  const LightingPass pass =
      run_lighting(Device::cpu, random_lighting(2, 1), bodies_in_turn(20, 1), 0.2F, posed);
  EXPECT_TRUE(all_finite(pass.grad_lighting.brightness));
  EXPECT_TRUE(all_finite(pass.grad_lighting.body_brightness));
  EXPECT_TRUE(all_finite(pass.grad_posed.position));
}

TEST(Lighting, IsTheSameBytesAtAnyThreadCount) {
  const Lighting lighting = random_lighting(4, 3);
  const PosedSurfels posed = random_posed(9000, 1);
  const Tensor<int32_t> body = bodies_in_turn(9000, 3);
  expect_same_bytes_at_any_thread_count([&] {
    LightingPass pass = run_lighting(Device::cpu, lighting, body, 0.42F, posed);
    lighting::resist(lighting, {1, 0.1, 0.1}, pass.grad_lighting);
    return std::vector<Tensor<float>>{pass.lit.sh, pass.grad_posed.sh, pass.grad_posed.position,
                                      pass.grad_lighting.brightness, pass.grad_lighting.body_brightness};
  });
}

}  // namespace
}  // namespace traceflow
