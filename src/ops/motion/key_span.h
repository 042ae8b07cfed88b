#pragma once

#include "math/rotation_group.h"
#include "scene/motion.h"

// The pose of a body between two keys, and its derivatives (scene/motion.h).
namespace traceflow::motion {

// The two keys around a time.
template <class T>
struct KeySpan {
  int64_t from = 0, to = 0;
  double share = 0;  // weight of `to`

  TRACEFLOW_HD KeySpan(const T* times, int64_t keys, double time) {
    int64_t low = 0, high = keys - 1;
    if (keys == 0 || time <= times[0]) {
      high = 0;
    } else if (time >= times[high]) {
      low = high;
    } else {
      while (high - low > 1) {
        const int64_t middle = (low + high) / 2;
        (times[middle] <= time ? low : high) = middle;
      }
    }
    from = low;
    to = high;
    const double length = low == high ? 0 : static_cast<double>(times[high]) - times[low];
    share = length > 0 ? (time - times[low]) / length : 0;
  }
};

struct BodyPose {
  Vec4<double> rotation;  // unit
  Vec3<double> shift;
};

// rotation, shift: the keys of one body.
template <class T>
TRACEFLOW_HD BodyPose body_pose(const T* rotation, const T* shift, const KeySpan<T>& span) {
  const Vec4<double> from = unit_quaternion(load4<double>(rotation + 4 * span.from));
  const Vec4<double> to = unit_quaternion(load4<double>(rotation + 4 * span.to));
  const Vec3<double> turn = quaternion_log(quaternion_product(to, quaternion_conjugate(from)));
  const Vec3<double> a = load3<double>(shift + 3 * span.from), b = load3<double>(shift + 3 * span.to);
  return {quaternion_product(quaternion_exp(span.share * turn), from), a + span.share * (b - a)};
}

// dL/d(a body's pose): by its translation, and by a rotation δ of the body about its centre.
struct PoseGradient {
  Vec3<double> force{0}, torque{0};

  TRACEFLOW_HD PoseGradient& operator+=(const PoseGradient& other) {
    force += other.force;
    torque += other.torque;
    return *this;
  }
};

// Adds to the gradients of one body's keys. With W = log(q₁ q₀⁻¹) and u the share of q₁, q = exp(u W) q₀
// rotates by u J(uW) (J⁻¹(W) δ₁ − J⁻¹(−W) δ₀) + exp(u W) δ₀.
template <class T>
TRACEFLOW_HD void body_pose_backward(const T* rotation, const KeySpan<T>& span, const PoseGradient& gradient,
                                     T* grad_rotation, T* grad_shift) {
  const double u = span.share;
  add3(grad_shift + 3 * span.from, (1 - u) * gradient.force);
  add3(grad_shift + 3 * span.to, u * gradient.force);
  const Vec4<double> q0 = load4<double>(rotation + 4 * span.from), q1 = load4<double>(rotation + 4 * span.to);
  const Vec3<double> turn =
      quaternion_log(quaternion_product(unit_quaternion(q1), quaternion_conjugate(unit_quaternion(q0))));
  const Vec3<double> through = u * left_jacobian(-u * turn, gradient.torque);
  const Vec3<double> by_to = left_jacobian_inverse(-turn, through);
  const Vec3<double> by_from = gradient.torque * rotation_from_quaternion(quaternion_exp(u * turn)) -
                               left_jacobian_inverse(turn, through);
  const auto add = [&](int64_t key, const Vec4<double>& q, const Vec3<double>& by_turn) {
    const Vec4<double> grad = quaternion_gradient(q, by_turn);
    for (int k = 0; k < 4; ++k) grad_rotation[4 * key + k] += static_cast<T>(grad[k]);
  };
  add(span.from, q0, by_from);
  if (span.to != span.from) add(span.to, q1, by_to);
}

}  // namespace traceflow::motion
