#include "math/sh_rotation.h"
#include "ops/motion/key_span.h"
#include "ops/motion/motion.h"

// Moves in double precision, one surfel after another.
namespace traceflow::motion {

namespace {

struct Body {
  Vec4<double> rotation;
  Mat3<double> matrix;
  Vec3<double> rest, now;
  ShRotation<double> harmonics;
};

Body body_at(const BasicMotion<double>& motion, int64_t b, double time) {
  const KeySpan<double> span(motion.time.data(), motion.keys(), time);
  const BodyPose pose = body_pose(motion.rotation.row(b), motion.shift.row(b), span);
  const Mat3<double> matrix = rotation_from_quaternion(pose.rotation);
  const Vec3<double> rest = load3<double>(motion.centre.row(b));
  return {pose.rotation, matrix, rest, rest + pose.shift, sh_rotation<double>(matrix)};
}

int degree_of(const BasicPosedSurfels<double>& posed) { return sh_degree(posed.sh.dim(1)); }

}  // namespace

void forward_reference(const BasicMotion<double>& motion, const Tensor<int32_t>& body, double time,
                       BasicPosedSurfels<double>& posed) {
  for (int64_t i = 0; i < posed.count(); ++i) {
    if (body[i] < 0) continue;
    const Body at = body_at(motion, body[i], time);
    store3(posed.position.row(i), at.matrix * (load3<double>(posed.position.row(i)) - at.rest) + at.now);
    const Vec4<double> q = quaternion_product(at.rotation, load4<double>(posed.rotation.row(i)));
    for (int k = 0; k < 4; ++k) posed.rotation(i, k) = q[k];
    double was[48];
    std::copy_n(posed.sh.row(i), posed.sh.row_size(), was);
    turn_harmonics(at.harmonics, degree_of(posed), was, posed.sh.row(i));
  }
}

void backward_reference(const BasicMotion<double>& motion, const Tensor<int32_t>& body, double time,
                        const BasicPosedSurfels<double>& posed, BasicPosedSurfels<double>& grad_posed,
                        BasicMotion<double>& grad_motion) {
  BasicPosedSurfels<double> moved = posed;
  forward_reference(motion, body, time, moved);
  std::vector<PoseGradient> gradients(static_cast<size_t>(motion.bodies()));
  for (int64_t i = 0; i < posed.count(); ++i) {
    if (body[i] < 0) continue;
    const Body at = body_at(motion, body[i], time);
    PoseGradient gradient;
    gradient.force = load3<double>(grad_posed.position.row(i));
    gradient.torque = cross(load3<double>(moved.position.row(i)) - at.now, gradient.force);
    const Vec4<double> grad_q = load4<double>(grad_posed.rotation.row(i));
    double was[48];
    for (int axis = 0; axis < 3; ++axis) {
      Vec3<double> about(0);
      about[axis] = 1;
      // d(exp(δ) q)/dδ = (0, axis)/2 · q
      const Vec4<double> rate = quaternion_product(Vec4<double>(0, about.x, about.y, about.z) * 0.5,
                                                   load4<double>(moved.rotation.row(i)));
      gradient.torque[axis] += dot(grad_q, rate);
      turn_harmonics(sh_generator<double>(about), degree_of(posed), moved.sh.row(i), was);
      for (int64_t k = 3; k < posed.sh.row_size(); ++k)
        gradient.torque[axis] += was[k] * grad_posed.sh.row(i)[k];
    }
    gradients[static_cast<size_t>(body[i])] += gradient;
    store3(grad_posed.position.row(i), transpose(at.matrix) * gradient.force);
    const Vec4<double> q = quaternion_product(quaternion_conjugate(at.rotation), grad_q);
    for (int k = 0; k < 4; ++k) grad_posed.rotation(i, k) = q[k];
    std::copy_n(grad_posed.sh.row(i), posed.sh.row_size(), was);
    turn_harmonics_back(at.harmonics, degree_of(posed), was, grad_posed.sh.row(i));
  }
  const KeySpan<double> span(motion.time.data(), motion.keys(), time);
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    body_pose_backward(motion.rotation.row(b), span, gradients[static_cast<size_t>(b)],
                       grad_motion.rotation.row(b), grad_motion.shift.row(b));
  }
}

}  // namespace traceflow::motion
