#include "ops/motion/nodes.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "motion_scene.h"
#include "ops/motion/key_span.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;

TEST(Nodes, MatchTheReference) {
  for (const float time : times) {
    const Nodes nodes = random_nodes(7, 3, 4);
    const PosedSurfels posed = random_posed(2000, 1);
    const Tensor<int32_t> body = bodies_in_turn(2000, 4);  // the last body has no nodes
    const NodesPass found = run_nodes(Device::cpu, nodes, body, time, posed);
    BasicPosedSurfels<double> bent = convert<double>(posed);
    nodes::forward_reference(convert<double>(nodes), body, time, bent);
    expect_close(found.bent.position, bent.position, 1e-5, "position");
    expect_close(found.bent.rotation, bent.rotation, 1e-5, "rotation");
    EXPECT_TRUE(same_bytes(found.bent.sh, posed.sh));
    EXPECT_TRUE(same_bytes(found.grad_posed.sh, found.grad_bent.sh));
  }
}

TEST(Nodes, BackwardMatchesCentralDifferencesOfTheReference) {
  for (const float time : times) {
    const Nodes nodes = random_nodes(5, 2, 3);
    const PosedSurfels posed = random_posed(6, 1);
    const Tensor<int32_t> body = bodies_in_turn(6, 2);
    const NodesPass found = run_nodes(Device::cpu, nodes, body, time, posed);
    BasicNodes<double> exact = convert<double>(nodes);
    BasicPosedSurfels<double> at = convert<double>(posed);
    const BasicPosedSurfels<double> weights = convert<double>(found.grad_bent);
    const auto loss = [&] {
      BasicPosedSurfels<double> bent = at;
      nodes::forward_reference(exact, body, time, bent);
      return testing::dot(bent, weights);
    };
    expect_close(found.grad_nodes.turn, central_differences(exact.turn, loss), 2e-5, "turn");
    expect_close(found.grad_nodes.shift, central_differences(exact.shift, loss), 2e-5, "shift");
    expect_close(found.grad_posed.position, central_differences(at.position, loss), 2e-5, "position");
    expect_close(found.grad_posed.rotation, central_differences(at.rotation, loss), 2e-5, "rotation");
  }
}

TEST(Nodes, ResistanceMatchesCentralDifferencesOfTheReference) {
  const Nodes nodes = random_nodes(6, 2, 4);
  const Motion motion = random_motion(2, 3);
  for (const nodes::Stiffness& weights :
       {nodes::Stiffness{1, 0, 0}, {0, 1, 0}, {0, 0.1, 1}, {0.3, 0.01, 0.2}}) {
    BasicNodes<double> exact = convert<double>(nodes);
    Nodes gradient = zeros_like<float>(nodes);
    nodes::resist(nodes, motion, weights, gradient);
    const auto loss = [&] { return nodes::resist_reference(exact, convert<double>(motion), weights); };
    expect_close(gradient.turn, central_differences(exact.turn, loss), 1e-5, "turn");
    expect_close(gradient.shift, central_differences(exact.shift, loss), 1e-5, "shift");
  }
}

// Nodes that all move as one rigid body bend nothing and resist nothing.
TEST(Nodes, ThatMoveAsOneKeepShapes) {
  Nodes nodes = random_nodes(6, 1, 2);
  const Vec3<double> turn(0.4, -0.7, 0.2), shift(0.3, 0.1, -0.2);
  const Mat3<double> rotation = rotation_from_quaternion(quaternion_exp(turn));
  for (int64_t n = 0; n < 6; ++n) {
    const Vec3<double> centre = load3<double>(nodes.centre.row(n));
    for (int64_t k = 0; k < 2; ++k) {
      store3(&nodes.turn(n, k, 0), turn);
      store3(&nodes.shift(n, k, 0), rotation * centre + shift - centre);
    }
  }
  Nodes gradient = zeros_like<float>(nodes);
  nodes::resist(nodes, random_motion(1, 2), {1, 1, 0}, gradient);
  for (const float by : gradient.turn.values()) EXPECT_NEAR(by, 0, 1e-6);
  for (const float by : gradient.shift.values()) EXPECT_NEAR(by, 0, 1e-6);
  const PosedSurfels posed = random_posed(50, 0);
  const PosedSurfels bent = run_nodes(Device::cpu, nodes, Tensor<int32_t>({50}), 0.4F, posed).bent;
  for (int64_t i = 0; i < 50; ++i) {
    const Vec3<double> expected = rotation * load3<double>(posed.position.row(i)) + shift;
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(bent.position(i, c), expected[c], 2e-6);
  }
}

// Nodes that stay where they are, whatever their body's pose, have not travelled.
TEST(Nodes, ThatStandStillHaveNoGradient) {
  Nodes nodes = random_nodes(6, 2, 4);
  const Motion motion = random_motion(2, 3);
  for (int64_t i = 0; i < 6 * 4; ++i) std::copy_n(nodes.centre.row(i / 4), 3, &nodes.anchor[3 * i]);
  for (int64_t n = 0; n < 6; ++n) {
    const int64_t b = nodes.body[n];
    const Vec3<double> rest = load3<double>(nodes.centre.row(n)),
                       centre = load3<double>(motion.centre.row(b));
    for (int64_t k = 0; k < nodes.times(); ++k) {
      const motion::KeySpan<float> span(motion.time.data(), motion.keys(), nodes.time[k]);
      const motion::BodyPose pose = motion::body_pose(motion.rotation.row(b), motion.shift.row(b), span);
      const Mat3<double> rotation = rotation_from_quaternion(pose.rotation);
      store3(&nodes.shift(n, k, 0), (rest - centre - pose.shift) * rotation + centre - rest);
    }
  }
  Nodes gradient = zeros_like<float>(nodes);
  nodes::resist(nodes, motion, {0, 0, 1}, gradient);
  for (const float by : gradient.shift.values()) EXPECT_NEAR(by, 0, 1e-4);
}

TEST(Nodes, HaveNoGradientAtTheirAnchors) {
  Nodes nodes = random_nodes(6, 2, 4);
  const Motion motion = random_motion(2, 3);
  for (int64_t n = 0; n < 6; ++n) {
    for (int64_t k = 0; k < 4; ++k) store3(&nodes.anchor(n, k, 0), nodes::place_of(nodes, motion, n, k));
  }
  Nodes gradient = zeros_like<float>(nodes);
  nodes::resist(nodes, motion, {0, 0, 1}, gradient);
  for (const float by : gradient.shift.values()) EXPECT_NEAR(by, 0, 1e-6);
}

TEST(Nodes, ABrokenSurfelGivesNothingAndTheFirstTimeIsHeld) {
  const Nodes nodes = random_nodes(3, 1, 3);
  PosedSurfels posed = random_posed(20, 1);
  posed.position(4, 1) = std::numeric_limits<float>::quiet_NaN();
  NodesPass pass = run_nodes(Device::cpu, nodes, Tensor<int32_t>({20}), 0.2F, posed);
  EXPECT_TRUE(all_finite(pass.grad_nodes.turn));
  EXPECT_TRUE(all_finite(pass.grad_nodes.shift));
  const Nodes before = pass.grad_nodes;
  nodes::hold_first(pass.grad_nodes);
  for (int64_t n = 0; n < 3; ++n) {
    for (int64_t k = 0; k < 3; ++k) {
      for (int c = 0; c < 3; ++c) {
        EXPECT_EQ(pass.grad_nodes.turn(n, k, c), k == 0 ? 0 : before.turn(n, k, c));
        EXPECT_EQ(pass.grad_nodes.shift(n, k, c), k == 0 ? 0 : before.shift(n, k, c));
      }
    }
  }
}

TEST(Nodes, AreTheSameBytesAtAnyThreadCount) {
  const Nodes nodes = random_nodes(9, 3, 4);
  const PosedSurfels posed = random_posed(9000, 1);
  const Tensor<int32_t> body = bodies_in_turn(9000, 3);
  expect_same_bytes_at_any_thread_count([&] {
    NodesPass pass = run_nodes(Device::cpu, nodes, body, 0.42F, posed);
    nodes::resist(nodes, random_motion(3, 4), {1, 0.1, 0.1}, pass.grad_nodes);
    return std::vector<Tensor<float>>{pass.bent.position,       pass.bent.rotation,
                                      pass.grad_posed.position, pass.grad_posed.rotation,
                                      pass.grad_nodes.turn,     pass.grad_nodes.shift};
  });
}

}  // namespace
}  // namespace traceflow
