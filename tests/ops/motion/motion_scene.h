#pragma once

#include <cstring>

#include "../deform/deform_scene.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"

namespace traceflow::testing {

// Before the first key of random_motion and random_nodes, on a key, between keys, behind the last one.
inline constexpr float times[] = {0.05F, 0.3F, 0.42F, 0.97F};

inline bool same_bytes(const Tensor<float>& a, const Tensor<float>& b) {
  return a.shape() == b.shape() &&
         std::memcmp(a.data(), b.data(), static_cast<size_t>(a.size()) * sizeof(float)) == 0;
}

// Bodies that turn and shift by much from key to key. Quaternions have any length.
inline Motion random_motion(int64_t bodies, int64_t keys, uint64_t seed = 5) {
  Random random(seed);
  Motion motion;
  motion.time.resize({keys});
  for (int64_t k = 0; k < keys; ++k)
    motion.time[k] = 0.1F + 0.8F * static_cast<float>(k) / static_cast<float>(keys);
  motion.centre = random_tensor<float>({bodies, 3}, random, -1, 1);
  motion.rotation = random_tensor<float>({bodies, keys, 4}, random, -1, 1);
  motion.shift = random_tensor<float>({bodies, keys, 3}, random, -1, 1);
  return motion;
}

// −1, 0 … bodies − 1, −1, …
inline Tensor<int32_t> bodies_in_turn(int64_t count, int64_t bodies) {
  Tensor<int32_t> body({count});
  for (int64_t i = 0; i < count; ++i) body[i] = static_cast<int32_t>(i % (bodies + 1)) - 1;
  return body;
}

inline PosedSurfels random_posed(int64_t count, int degree, bool tint = true, uint64_t seed = 31) {
  Random random(seed);
  PosedSurfels posed;
  posed.position = random_tensor<float>({count, 3}, random, -1.5, 1.5);
  posed.scale = random_tensor<float>({count, 2}, random, 0.01, 0.3);
  posed.rotation = random_tensor<float>({count, 4}, random, -1, 1);
  posed.opacity = random_tensor<float>({count}, random, 0.1, 0.9);
  posed.sh = random_tensor<float>({count, sh_coefficients(degree), 3}, random, -1, 1);
  if (tint) posed.tint = random_tensor<float>({count}, random, 0.1, 0.9);
  return posed;
}

// One forward and backward pass with a random gradient, on the host.
struct MotionPass {
  PosedSurfels moved, grad_moved, grad_posed;
  Motion grad_motion;
};
inline MotionPass run_motion(Device device, const Motion& motion, const Tensor<int32_t>& body, float time,
                             const PosedSurfels& posed, const Tensor<int32_t>& subset = {},
                             bool frozen = false) {
  const Motion there = motion.on(device);
  const Tensor<int32_t> body_there = body.on(device), subset_there = subset.on(device);
  PosedSurfels moved = posed.on(device);
  const motion::SavedPtr saved = motion::make_saved();
  motion::forward(there, body_there, time, subset_there, moved, *saved);
  const PosedSurfels grad_moved = random_gradient_like(posed);
  PosedSurfels grad_posed = grad_moved.on(device);
  Motion grad_motion = zeros_like<float>(there);
  motion::backward(there, body_there, time, subset_there, moved, *saved, grad_posed,
                   frozen ? nullptr : &grad_motion);
  return {moved.on(Device::cpu), grad_moved, grad_posed.on(Device::cpu), grad_motion.on(Device::cpu)};
}

// Nodes of bodies in turn, that turn and shift by much.
inline Nodes random_nodes(int64_t count, int64_t bodies, int64_t keys, uint64_t seed = 6) {
  Random random(seed);
  Nodes nodes;
  nodes.body.resize({count});
  for (int64_t n = 0; n < count; ++n) nodes.body[n] = static_cast<int32_t>(n % bodies);
  nodes.time.resize({keys});
  for (int64_t k = 0; k < keys; ++k)
    nodes.time[k] = 0.1F + 0.8F * static_cast<float>(k) / static_cast<float>(keys);
  nodes.centre = random_tensor<float>({count, 3}, random, -1, 1);
  nodes.radius = random_tensor<float>({count}, random, 0.4, 0.9);
  nodes.turn = random_tensor<float>({count, keys, 3}, random, -1, 1);
  nodes.shift = random_tensor<float>({count, keys, 3}, random, -1, 1);
  nodes.anchor = random_tensor<float>({count, keys, 3}, random, -1, 1);
  return nodes;
}

// One forward and backward pass with a random gradient, on the host.
struct NodesPass {
  PosedSurfels bent, grad_bent, grad_posed;
  Nodes grad_nodes;
};
inline NodesPass run_nodes(Device device, const Nodes& nodes, const Tensor<int32_t>& body, float time,
                           const PosedSurfels& posed) {
  const Nodes there = nodes.on(device);
  const Tensor<int32_t> body_there = body.on(device);
  PosedSurfels bent = posed.on(device);
  const nodes::SavedPtr saved = nodes::make_saved();
  nodes::forward(there, body_there, time, {}, bent, *saved);
  const PosedSurfels grad_bent = random_gradient_like(posed);
  PosedSurfels grad_posed = grad_bent.on(device);
  Nodes grad_nodes = zeros_like<float>(there);
  nodes::backward(there, body_there, time, {}, *saved, grad_posed, &grad_nodes);
  return {bent.on(Device::cpu), grad_bent, grad_posed.on(Device::cpu), grad_nodes.on(Device::cpu)};
}

}  // namespace traceflow::testing
