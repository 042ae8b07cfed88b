#pragma once

#include <cstdint>

#include "math/rotation_group.h"
#include "ops/motion/key_span.h"
#include "ops/motion/motion_kernels.h"
#include "ops/motion/nodes.h"

// The steps of bending, on either device.
namespace traceflow::nodes {

using motion::CarrierOf;

// A node at one time.
struct PosedNode {
  Mat3<float> rotation;
  Vec3<float> turn, shift, rest;
  float per_radius2;  // 1/r²
  int32_t body;
};

struct PoseNode {
  const int32_t* body;
  const float *times, *centre, *radius, *turn, *shift;
  int64_t keys;
  double time;
  PosedNode* to;

  TRACEFLOW_HD void operator()(int64_t n) const {
    const motion::KeySpan<float> span(times, keys, time);
    const auto at = [&](const float* values) {
      const Vec3<double> a = load3<double>(values + 3 * (keys * n + span.from));
      const Vec3<double> b = load3<double>(values + 3 * (keys * n + span.to));
      return a + span.share * (b - a);
    };
    const Vec3<double> w = at(turn);
    to[n] = {Mat3<float>(rotation_from_quaternion(quaternion_exp(w))),
             Vec3<float>(w),
             Vec3<float>(at(shift)),
             load3<float>(centre + 3 * n),
             1 / (radius[n] * radius[n]),
             body[n]};
  }
};

// A surfel before bending.
struct RestSurfel {
  Vec3<float> position, turn;  // turn: Σ w_n ω_n
  Vec4<float> rotation;
};

// Weights are stored node by node: that of surfel i is weights[n·count + i].
struct BendSurfel {
  CarrierOf carrier;
  const PosedNode* nodes;
  int64_t node_count, count;
  float *position, *rotation;
  float* weights;
  RestSurfel* rest;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const int32_t body = carrier(i);
    const Vec3<float> p = load3<float>(position + 3 * i);
    float nearest = INFINITY;
    for (int64_t n = 0; n < node_count; ++n) {
      const PosedNode& node = nodes[n];
      const Vec3<float> arm = p - node.rest;
      const float exponent =
          body >= 0 && node.body == body ? 0.5F * dot(arm, arm) * node.per_radius2 : INFINITY;
      weights[n * count + i] = exponent;
      nearest = exponent < nearest ? exponent : nearest;
    }
    rest[i] = {p, Vec3<float>(0), load4<float>(rotation + 4 * i)};
    float sum = 0;
    for (int64_t n = 0; n < node_count; ++n) {
      float& weight = weights[n * count + i];
      weight = weight < INFINITY ? std::exp(nearest - weight) : 0.0F;
      sum += weight;
    }
    if (!(sum > 0)) return;
    Vec3<float> bent(0), turn(0);
    for (int64_t n = 0; n < node_count; ++n) {
      float& weight = weights[n * count + i];
      if (weight == 0) continue;
      weight /= sum;
      const PosedNode& node = nodes[n];
      bent += weight * (node.rotation * (p - node.rest) + node.rest + node.shift);
      turn += weight * node.turn;
    }
    rest[i].turn = turn;
    store3(position + 3 * i, bent);
    motion::store4(rotation + 4 * i, quaternion_product(quaternion_exp(turn), rest[i].rotation));
  }
};

// Writes the gradient by Σ w_n ω_n of surfel i to turns.
struct TurnGradient {
  const RestSurfel* rest;
  const float* grad_rotation;
  Vec3<float>* turns;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const Vec3<double> turn(rest[i].turn);
    const Vec4<double> bent = quaternion_product(quaternion_exp(turn), Vec4<double>(rest[i].rotation));
    const Vec3<double> torque = quaternion_torque(bent, load4<double>(grad_rotation + 4 * i));
    turns[i] = Vec3<float>(left_jacobian(-turn, torque));
  }
};

// The sum of the surfels' gradients at a node: by its shift, by a rotation from the left of the offsets of
// its surfels, and by Σ w_n ω_n.
struct NodeGradient {
  Vec3<double> force{0}, torque{0}, turn{0};

  TRACEFLOW_HD NodeGradient& operator+=(const NodeGradient& other) {
    force += other.force;
    torque += other.torque;
    turn += other.turn;
    return *this;
  }
};

struct NodeGradientOfSurfel {
  const PosedNode* node;
  const float* weights;  // of this node
  const RestSurfel* rest;
  const Vec3<float>* turns;
  const float* grad_position;

  TRACEFLOW_HD NodeGradient operator()(int64_t i) const {
    NodeGradient gradient;
    const double weight = weights[i];
    if (weight == 0) return gradient;
    const Vec3<double> arm(node->rotation * (rest[i].position - node->rest));
    gradient.force = weight * load3<double>(grad_position + 3 * i);
    gradient.torque = cross(arm, gradient.force);
    gradient.turn = weight * Vec3<double>(turns[i]);
    const double sum = dot(gradient.force, gradient.force) + dot(gradient.torque, gradient.torque) +
                       dot(gradient.turn, gradient.turn);
    return sum * 0 == 0 ? gradient : NodeGradient();
  }
};

struct AddToKeys {
  const NodeGradient* gradients;
  const PosedNode* nodes;
  const float* times;
  int64_t keys;
  double time;
  float *grad_turn, *grad_shift;

  TRACEFLOW_HD void operator()(int64_t n) const {
    const motion::KeySpan<float> span(times, keys, time);
    const Vec3<double> by_turn =
        left_jacobian(-Vec3<double>(nodes[n].turn), gradients[n].torque) + gradients[n].turn;
    const auto add = [&](float* to, const Vec3<double>& by) {
      add3(to + 3 * (keys * n + span.from), (1 - span.share) * by);
      add3(to + 3 * (keys * n + span.to), span.share * by);
    };
    add(grad_turn, by_turn);
    add(grad_shift, gradients[n].force);
  }
};

// The gradient by a surfel before bending. i: a surfel.
struct BendGradientBack {
  const PosedNode* nodes;
  int64_t node_count, count;
  const float* weights;
  const RestSurfel* rest;
  const Vec3<float>* turns;
  float *position, *rotation;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const Vec3<float> force = load3<float>(position + 3 * i), p = rest[i].position;
    // Weights depend on the position: ∂w_n/∂p = w_n (a_n − Σ w a), a_n = −(p − c_n)/r_n².
    Vec3<float> direct(0), lean(0), by_weights(0);
    float mean = 0, sum = 0;
    for (int64_t n = 0; n < node_count; ++n) {
      const float weight = weights[n * count + i];
      if (weight == 0) continue;
      const PosedNode& node = nodes[n];
      const Vec3<float> arm = p - node.rest;
      // The displacement of the surfel, not its position: otherwise the mean of large numbers would be
      // subtracted from them.
      const Vec3<float> carried = node.rotation * arm - arm + node.shift;
      const float by_weight = dot(force, carried) + dot(turns[i], node.turn);
      const Vec3<float> a = -node.per_radius2 * arm;
      direct += weight * (force * node.rotation);
      lean += weight * a;
      by_weights += (weight * by_weight) * a;
      mean += weight * by_weight;
      sum += weight;
    }
    if (sum == 0) return;
    store3(position + 3 * i, direct + by_weights - mean * lean);
    motion::store4(rotation + 4 * i, quaternion_product(quaternion_conjugate(quaternion_exp(rest[i].turn)),
                                                        load4<float>(rotation + 4 * i)));
  }
};

// Where bodies move a point at a time.
struct BodyPoses {
  const float *times, *centre, *rotation, *shift;
  int64_t keys;

  struct Pose {
    Mat3<double> rotation;
    Vec3<double> rest, now;  // the body's centre, at rest and now

    TRACEFLOW_HD Vec3<double> operator()(const Vec3<double>& p) const { return rotation * (p - rest) + now; }
  };
  TRACEFLOW_HD Pose at(int64_t b, double time) const {
    const motion::KeySpan<float> span(times, keys, time);
    const motion::BodyPose pose = motion::body_pose(rotation + 4 * keys * b, shift + 3 * keys * b, span);
    const Vec3<double> rest = load3<double>(centre + 3 * b);
    return {rotation_from_quaternion(pose.rotation), rest, rest + pose.shift};
  }
};

// The stiffness of the nodes.
struct Resistance {
  BodyPoses poses;
  const int32_t* body;
  const float *times, *centre, *radius, *turn, *shift, *anchor;
  int64_t count, keys;
  Stiffness weights;

  TRACEFLOW_HD Vec3<double> at(const float* values, int64_t n, int64_t k) const {
    return load3<double>(values + 3 * (keys * n + k));
  }
  TRACEFLOW_HD double per_radius2(int64_t n) const {
    return 1 / (static_cast<double>(radius[n]) * radius[n]);
  }

  // a_nm before normalisation; 0 for different bodies and for n = m.
  TRACEFLOW_HD double touch(int64_t n, int64_t m) const {
    if (n == m || body[n] != body[m]) return 0;
    const Vec3<double> arm = load3<double>(centre + 3 * m) - load3<double>(centre + 3 * n);
    return std::exp(-dot(arm, arm) * per_radius2(n) / 8);
  }
  TRACEFLOW_HD double touches(int64_t n) const {
    double sum = 0;
    for (int64_t m = 0; m < count; ++m) sum += touch(n, m);
    return sum;
  }
  TRACEFLOW_HD double share() const { return 1 / static_cast<double>(count * keys); }

  // c_m − c_n rotated by n's turn. apart() is the position of m's centre as moved by n, minus that as moved
  // by m.
  TRACEFLOW_HD Vec3<double> arm(int64_t n, int64_t m, int64_t k) const {
    return rotation_from_quaternion(quaternion_exp(at(turn, n, k))) *
           (load3<double>(centre + 3 * m) - load3<double>(centre + 3 * n));
  }
  TRACEFLOW_HD Vec3<double> apart(int64_t n, int64_t m, int64_t k) const {
    return arm(n, m, k) + load3<double>(centre + 3 * n) + at(shift, n, k) - load3<double>(centre + 3 * m) -
           at(shift, m, k);
  }
  // The gradient of n's travel by its shift.
  TRACEFLOW_HD Vec3<double> travel_gradient(int64_t n, int64_t k) const {
    const Vec3<double> rest = load3<double>(centre + 3 * n);
    const BodyPoses::Pose pose = poses.at(body[n], times[k]);
    const Vec3<double> off =
        (pose(rest + at(shift, n, k)) - at(anchor, n, k)) / static_cast<double>(radius[n]);
    const double force = weights.travel / std::pow(1 + dot(off, off), 2);
    return (force / static_cast<double>(radius[n]) * off) * pose.rotation;
  }
};

struct ResistanceGradient {
  Resistance of;
  float *grad_turn, *grad_shift;

  // i: node n at time k. Adds the gradient of everything that depends on its turn and shift.
  TRACEFLOW_HD void operator()(int64_t i) const {
    const int64_t n = i / of.keys, k = i % of.keys;
    const double all = of.touches(n);
    Vec3<double> by_turn(0), by_shift(0), torque(0);
    for (int64_t m = 0; m < of.count; ++m) {
      const double mine = of.touch(n, m);
      if (mine == 0) continue;
      const Vec3<double> force = 2 * of.weights.strain * mine / all * of.per_radius2(n) * of.apart(n, m, k);
      torque += cross(of.arm(n, m, k), force);
      by_shift += force;
      const double theirs = of.touch(m, n) / of.touches(m);
      by_shift -= 2 * of.weights.strain * theirs * of.per_radius2(m) * of.apart(m, n, k);
    }
    by_turn = left_jacobian(-of.at(of.turn, n, k), torque);
    const auto hurry = [&](int64_t from) {
      const double span = static_cast<double>(of.times[from + 1]) - of.times[from];
      const double by = 2 * of.weights.haste / (span * span) * (from == k ? -1 : 1);
      by_turn += by * (of.at(of.turn, n, from + 1) - of.at(of.turn, n, from));
      by_shift += by * of.per_radius2(n) * (of.at(of.shift, n, from + 1) - of.at(of.shift, n, from));
    };
    if (k + 1 < of.keys) hurry(k);
    if (k > 0) hurry(k - 1);
    by_shift += of.travel_gradient(n, k);
    add3(grad_turn + 3 * i, of.share() * by_turn);
    add3(grad_shift + 3 * i, of.share() * by_shift);
  }
};

struct HoldFirst {
  int64_t keys;
  float *turn, *shift;

  TRACEFLOW_HD void operator()(int64_t n) const {
    for (int64_t c = 0; c < 3; ++c) turn[3 * keys * n + c] = shift[3 * keys * n + c] = 0;
  }
};

}  // namespace traceflow::nodes
