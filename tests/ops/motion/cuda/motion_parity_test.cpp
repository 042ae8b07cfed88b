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
