#include "../motion_scene.h"
#include "support/device.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;
using MotionOnDevice = OnDevice;

TEST_F(MotionOnDevice, AgreesWithTheCpu) {
  for (const int degree : {0, 3}) {
    const Motion motion = random_motion(3, 5);
    const PosedSurfels posed = random_posed(700, degree);
    const Tensor<int32_t> body = bodies_in_turn(700, 3);
    const MotionPass expected = run_motion(Device::cpu, motion, body, 0.42F, posed);
    const MotionPass found = run_motion(Device::cuda, motion, body, 0.42F, posed);
    expect_close(found.moved.position, expected.moved.position, 5e-6, "position");
    expect_close(found.moved.rotation, expected.moved.rotation, 5e-6, "rotation");
    expect_close(found.moved.sh, expected.moved.sh, 5e-6, "sh");
    expect_close(found.grad_posed.position, expected.grad_posed.position, 5e-6, "by position");
    expect_close(found.grad_posed.sh, expected.grad_posed.sh, 5e-6, "by sh");
    expect_close(found.grad_motion.rotation, expected.grad_motion.rotation, 1e-5, "by body's rotation");
    expect_close(found.grad_motion.shift, expected.grad_motion.shift, 1e-5, "by shift");
  }
}

TEST_F(MotionOnDevice, SpreadsGradientsAsTheCpu) {
  const Motion motion = random_motion(2, 25);
  Motion here = random_motion(2, 25), there = here.on(Device::cuda);
  motion::spread_over_keys(motion, 2.5F, here);
  motion::spread_over_keys(motion.on(Device::cuda), 2.5F, there);
  expect_close(there.rotation.on(Device::cpu), here.rotation, 1e-5, "rotation");
  expect_close(there.shift.on(Device::cpu), here.shift, 1e-5, "shift");
}

TEST_F(MotionOnDevice, HoldsOpacitiesAsTheCpu) {
  Surfels here;
  here.position.reset({700, 3});
  here.opacity_logit.reset({700});
  here.opacity_logit.fill(2);
  Surfels there = here.on(Device::cuda);
  const Tensor<int32_t> body = bodies_in_turn(700, 3);
  motion::hold_opacities(body, 650, here);
  motion::hold_opacities(body.on(Device::cuda), 650, there);
  EXPECT_TRUE(same_bytes(there.opacity_logit.on(Device::cpu), here.opacity_logit));
}

TEST_F(MotionOnDevice, BendsAsTheCpu) {
  const Nodes nodes = random_nodes(7, 2, 4);
  const PosedSurfels posed = random_posed(700, 1);
  const Tensor<int32_t> body = bodies_in_turn(700, 3);
  const NodesPass expected = run_nodes(Device::cpu, nodes, body, 0.42F, posed);
  const NodesPass found = run_nodes(Device::cuda, nodes, body, 0.42F, posed);
  expect_close(found.bent.position, expected.bent.position, 5e-6, "position");
  expect_close(found.bent.rotation, expected.bent.rotation, 5e-6, "rotation");
  expect_close(found.grad_posed.position, expected.grad_posed.position, 1e-5, "by position");
  expect_close(found.grad_posed.rotation, expected.grad_posed.rotation, 1e-5, "by rotation");
  expect_close(found.grad_nodes.turn, expected.grad_nodes.turn, 1e-5, "by turn");
  expect_close(found.grad_nodes.shift, expected.grad_nodes.shift, 1e-5, "by shift");
  Nodes grad_here = zeros_like<float>(nodes), grad_there = grad_here.on(Device::cuda);
  const Motion motion = random_motion(3, 4);
  const nodes::Stiffness weights{0.3, 0.01, 0.2};
  nodes::resist(nodes, motion, weights, grad_here);
  nodes::resist(nodes.on(Device::cuda), motion.on(Device::cuda), weights, grad_there);
  expect_close(grad_there.turn.on(Device::cpu), grad_here.turn, 1e-5, "resistance by turn");
  expect_close(grad_there.shift.on(Device::cpu), grad_here.shift, 1e-5, "resistance by shift");
}

TEST_F(MotionOnDevice, IsTheSameBytesTwice) {
  const Motion motion = random_motion(2, 4);
  const PosedSurfels posed = random_posed(3000, 2);
  const Tensor<int32_t> body = bodies_in_turn(3000, 2);
  const MotionPass once = run_motion(Device::cuda, motion, body, 0.42F, posed);
  const MotionPass twice = run_motion(Device::cuda, motion, body, 0.42F, posed);
  EXPECT_TRUE(same_bytes(once.moved.sh, twice.moved.sh));
  EXPECT_TRUE(same_bytes(once.grad_motion.rotation, twice.grad_motion.rotation));
}

}  // namespace
}  // namespace traceflow
