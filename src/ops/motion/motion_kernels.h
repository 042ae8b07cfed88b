#pragma once

#include <cmath>
#include <cstdint>

#include "math/sh_rotation.h"
#include "ops/motion/key_span.h"
#include "scene/surfel_views.h"

// The steps of moving the surfels of bodies, on either device.
namespace traceflow::motion {

// A body at one time.
struct PosedBody {
  Vec4<float> rotation;   // unit
  Vec3<float> rest, now;  // its centre, at rest and now
  ShRotation<float> harmonics;
};

// i: a body.
struct PoseBody {
  const float *times, *centre, *rotation, *shift;
  int64_t keys;
  double time;
  PosedBody* to;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const KeySpan<float> span(times, keys, time);
    const BodyPose pose = body_pose(rotation + 4 * keys * i, shift + 3 * keys * i, span);
    const Vec3<double> rest = load3<double>(centre + 3 * i);
    to[i] = {Vec4<float>(pose.rotation), Vec3<float>(rest), Vec3<float>(rest + pose.shift),
             sh_rotation<float>(rotation_from_quaternion(pose.rotation))};
  }
};

// The body of posed surfel i; −1: none.
struct CarrierOf {
  const int32_t* body;
  const int32_t* subset;  // null: all

  TRACEFLOW_HD int32_t operator()(int64_t i) const {
    return body[subset == nullptr ? i : int64_t{subset[i]}];
  }
};

TRACEFLOW_HD inline Vec4<float> turned(const Vec4<float>& rotation, const float* quaternion) {
  return quaternion_product(rotation, load4<float>(quaternion));
}
TRACEFLOW_HD inline void store4(float* to, const Vec4<float>& q) {
  for (int k = 0; k < 4; ++k) to[k] = q[k];
}

// i: a surfel.
struct MoveSurfel {
  CarrierOf carrier;
  const PosedBody* bodies;
  float *position, *rotation, *sh;
  int64_t sh_row;
  int degree;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const int32_t b = carrier(i);
    if (b < 0) return;
    const PosedBody& body = bodies[b];
    const Mat3<float> turn = rotation_from_quaternion(body.rotation);
    store3(position + 3 * i, turn * (load3<float>(position + 3 * i) - body.rest) + body.now);
    store4(rotation + 4 * i, turned(body.rotation, rotation + 4 * i));
    float was[48];
    float* const values = sh + sh_row * i;
    for (int64_t k = 0; k < sh_row; ++k) was[k] = values[k];
    turn_harmonics(body.harmonics, degree, was, values);
  }
};

// The contribution of surfel i to the gradient by the pose of one body.
struct PoseGradientOfSurfel {
  CarrierOf carrier;
  int32_t which;
  const PosedBody* bodies;
  const ShRotation<float>* generators;  // about x, y, z
  PosedSurfelsView moved, grad;

  TRACEFLOW_HD PoseGradient operator()(int64_t i) const {
    PoseGradient gradient;
    if (carrier(i) != which || moved.opacity[i] == 0) return gradient;
    const PosedBody& body = bodies[which];
    const Vec3<double> force = load3<double>(grad.position + 3 * i);
    const Vec3<double> arm = load3<double>(moved.position + 3 * i) - Vec3<double>(body.now);
    gradient.force = force;
    gradient.torque = cross(arm, force) + quaternion_torque(load4<double>(moved.rotation + 4 * i),
                                                            load4<double>(grad.rotation + 4 * i));
    const float *sh = moved.sh + moved.sh_row * i, *grad_sh = grad.sh + grad.sh_row * i;
    for (int axis = 0; axis < 3; ++axis) {
      float rate[48];
      turn_harmonics(generators[axis], moved.sh_degree, sh, rate);
      for (int64_t k = 3; k < grad.sh_row; ++k) gradient.torque[axis] += double{rate[k]} * grad_sh[k];
    }
    const double sum = dot(gradient.force, gradient.force) + dot(gradient.torque, gradient.torque);
    return sum * 0 == 0 ? gradient : PoseGradient();
  }
};

// i: a body.
struct AddToKeys {
  const PoseGradient* gradients;
  const float *times, *rotation;
  int64_t keys;
  double time;
  float *grad_rotation, *grad_shift;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const KeySpan<float> span(times, keys, time);
    body_pose_backward(rotation + 4 * keys * i, span, gradients[i], grad_rotation + 4 * keys * i,
                       grad_shift + 3 * keys * i);
  }
};

// i: a body.
struct HoldFirstKey {
  int64_t keys;
  float *rotation, *shift;

  TRACEFLOW_HD void operator()(int64_t i) const {
    for (int k = 0; k < 4; ++k) rotation[4 * keys * i + k] = 0;
    for (int k = 0; k < 3; ++k) shift[3 * keys * i + k] = 0;
  }
};

// i: a surfel.
struct HoldOpacity {
  const int32_t* body;
  float* opacity_logit;

  TRACEFLOW_HD void operator()(int64_t i) const {
    if (body[i] >= 0) opacity_logit[i] = 0;
  }
};

// i: a body's key.
struct SpreadOverKeys {
  const float* from;
  const float* rotation;  // of the motion, if these are gradients by it; otherwise null
  int64_t keys, numbers;
  float width;
  float* to;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const int64_t key = i % keys, first = i - key;
    const auto half_window = static_cast<int64_t>(3 * width);
    const int64_t begin = key > half_window ? key - half_window : 0,
                  end = key + half_window < keys ? key + half_window + 1 : keys;
    float* const sum = to + numbers * i;
    for (int64_t k = 0; k < numbers; ++k) sum[k] = 0;
    for (int64_t other = begin; other < end; ++other) {
      const float distance = static_cast<float>(other - key) / width;
      float share = std::exp(-0.5F * distance * distance);
      // q and −q are the same rotation.
      if (rotation != nullptr &&
          dot(load4<float>(rotation + 4 * i), load4<float>(rotation + 4 * (first + other))) < 0)
        share = -share;
      for (int64_t k = 0; k < numbers; ++k) sum[k] += share * from[numbers * (first + other) + k];
    }
  }
};

// The gradient by a surfel before the motion. i: a surfel.
struct TurnGradientBack {
  CarrierOf carrier;
  const PosedBody* bodies;
  float *position, *rotation, *sh;
  int64_t sh_row;
  int degree;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const int32_t b = carrier(i);
    if (b < 0) return;
    const PosedBody& body = bodies[b];
    store3(position + 3 * i, load3<float>(position + 3 * i) * rotation_from_quaternion(body.rotation));
    store4(rotation + 4 * i, turned(quaternion_conjugate(body.rotation), rotation + 4 * i));
    float was[48];
    float* const values = sh + sh_row * i;
    for (int64_t k = 0; k < sh_row; ++k) was[k] = values[k];
    turn_harmonics_back(body.harmonics, degree, was, values);
  }
};

}  // namespace traceflow::motion
