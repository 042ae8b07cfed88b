#include <cmath>
#include <vector>

#include "math/rotation_group.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"

// Bends in double precision, one surfel after another. Gradients are central differences.
namespace traceflow::nodes {

namespace {

// The turn or shift of a node at a time.
Vec3<double> value_at(const BasicNodes<double>& nodes, const Tensor<double>& values, int64_t n, double time) {
  const int64_t last = nodes.times() - 1;
  if (time <= nodes.time[0]) return load3<double>(&values(n, 0, 0));
  for (int64_t k = 0; k < last; ++k) {
    if (time > nodes.time[k + 1]) continue;
    const double share = (time - nodes.time[k]) / (nodes.time[k + 1] - nodes.time[k]);
    return (1 - share) * load3<double>(&values(n, k, 0)) + share * load3<double>(&values(n, k + 1, 0));
  }
  return load3<double>(&values(n, last, 0));
}

double distance2(const BasicNodes<double>& nodes, int64_t n, const Vec3<double>& p) {
  const Vec3<double> arm = p - load3<double>(nodes.centre.row(n));
  return dot(arm, arm);
}

Vec3<double> moved_by_node(const BasicNodes<double>& nodes, int64_t n, const Vec3<double>& turn,
                           const Vec3<double>& shift, const Vec3<double>& p) {
  const Vec3<double> centre = load3<double>(nodes.centre.row(n));
  return rotation_from_quaternion(quaternion_exp(turn)) * (p - centre) + centre + shift;
}

// Squared distance from a node's anchor to the node as moved by its body's pose.
double travelled2(const BasicNodes<double>& nodes, const BasicMotion<double>& motion, int64_t n, int64_t k) {
  const Vec3<double> rest = load3<double>(nodes.centre.row(n));
  BasicPosedSurfels<double> point;
  point.position.resize({1, 3});
  point.rotation.reset({1, 4});
  point.sh.reset({1, 1, 3});
  store3(point.position.row(0), rest + load3<double>(&nodes.shift(n, k, 0)));
  Tensor<int32_t> body({1});
  body[0] = nodes.body[n];
  motion::forward_reference(motion, body, nodes.time[k], point);
  const Vec3<double> off = load3<double>(point.position.row(0)) - load3<double>(&nodes.anchor(n, k, 0));
  return dot(off, off);
}

double geman_mcclure(double distance2) { return distance2 / (1 + distance2) / 2; }

}  // namespace

void forward_reference(const BasicNodes<double>& nodes, const Tensor<int32_t>& body, double time,
                       BasicPosedSurfels<double>& posed) {
  for (int64_t i = 0; i < posed.count(); ++i) {
    const Vec3<double> p = load3<double>(posed.position.row(i));
    Vec3<double> bent(0), turn(0);
    double sum = 0;
    for (int64_t n = 0; n < nodes.count(); ++n) {
      if (body[i] < 0 || nodes.body[n] != body[i]) continue;
      const double weight = std::exp(-distance2(nodes, n, p) / (2 * nodes.radius[n] * nodes.radius[n]));
      const Vec3<double> w = value_at(nodes, nodes.turn, n, time);
      sum += weight;
      turn += weight * w;
      bent += weight * moved_by_node(nodes, n, w, value_at(nodes, nodes.shift, n, time), p);
    }
    if (sum == 0) continue;
    store3(posed.position.row(i), bent / sum);
    const Vec4<double> q =
        quaternion_product(quaternion_exp(turn / sum), load4<double>(posed.rotation.row(i)));
    for (int c = 0; c < 4; ++c) posed.rotation(i, c) = q[c];
  }
}

double resist_reference(const BasicNodes<double>& nodes, const BasicMotion<double>& motion,
                        const Stiffness& weights) {
  double total = 0;
  for (int64_t n = 0; n < nodes.count(); ++n) {
    const double radius2 = nodes.radius[n] * nodes.radius[n];
    for (int64_t k = 0; k < nodes.times(); ++k) {
      const Vec3<double> turn = load3<double>(&nodes.turn(n, k, 0)),
                         shift = load3<double>(&nodes.shift(n, k, 0));
      double apart = 0, all = 0;
      for (int64_t m = 0; m < nodes.count(); ++m) {
        if (m == n || nodes.body[m] != nodes.body[n]) continue;
        const Vec3<double> other = load3<double>(nodes.centre.row(m));
        const double touch = std::exp(-distance2(nodes, n, other) / (8 * radius2));
        const Vec3<double> off =
            moved_by_node(nodes, n, turn, shift, other) - other - load3<double>(&nodes.shift(m, k, 0));
        apart += touch * dot(off, off);
        all += touch;
      }
      if (all > 0) total += weights.strain * apart / all / radius2;
      total += weights.travel * geman_mcclure(travelled2(nodes, motion, n, k) / radius2);
      if (k + 1 == nodes.times()) continue;
      const double span = nodes.time[k + 1] - nodes.time[k];
      const Vec3<double> turned = (load3<double>(&nodes.turn(n, k + 1, 0)) - turn) / span;
      const Vec3<double> shifted = (load3<double>(&nodes.shift(n, k + 1, 0)) - shift) / span;
      total += weights.haste * (dot(turned, turned) + dot(shifted, shifted) / radius2);
    }
  }
  return total / static_cast<double>(nodes.count() * nodes.times());
}

}  // namespace traceflow::nodes
