#pragma once

#include "base/tensor.h"

namespace traceflow {

// How bodies bend (scene/motion.h). Each of N nodes belongs to one body, has a position c_n where the body is
// at rest, and has a turn and a shift at each of L times. A point p of a body at rest bends to
//   Σ w_n (R_n (p − c_n) + c_n + s_n) over the body's nodes, w_n ∝ exp(−|p − c_n|²/2r_n²) with Σ w_n = 1,
// before the body's pose moves it. Turns and shifts are linear between times, and constant before the first
// and after the last. Also holds gradients and Adam's moments. T is float in the program, double in
// references.
template <class T>
struct BasicNodes {
  Tensor<int32_t> body;  // N, 0 to bodies − 1
  Tensor<T> time;        // L, ascending, in [0, 1]
  Tensor<T> centre;      // N×3, scene units. Not trained
  Tensor<T> radius;      // N, above 0, scene units. Not trained
  Tensor<T> turn;        // N×L×3, rotation vectors, radians
  Tensor<T> shift;       // N×L×3, scene units
  Tensor<T> anchor;  // N×L×3, where training tries to keep nodes (ops/motion/nodes.h), world, scene units.
                     // Not trained

  int64_t count() const { return body.size(); }
  int64_t times() const { return time.size(); }

  Device device() const { return centre.device(); }
  // A copy on a device.
  BasicNodes on(Device device) const {
    return {body.on(device), time.on(device),  centre.on(device), radius.on(device),
            turn.on(device), shift.on(device), anchor.on(device)};
  }

  // Takes the shapes and the device of others, and reuses the memory.
  void resize_like(const BasicNodes& other) {
    const Device device = other.device();
    body.place(device).resize(other.body.shape());
    for (const auto& [to, from] : {std::pair{&time, &other.time},
                                   {&centre, &other.centre},
                                   {&radius, &other.radius},
                                   {&turn, &other.turn},
                                   {&shift, &other.shift},
                                   {&anchor, &other.anchor}}) {
      to->place(device).resize(from->shape());
    }
  }

  // Calls f(name, tensor) for every group that is trained.
  template <class F>
  void for_each(F&& f) {
    f("turn", turn);
    f("shift", shift);
  }
  template <class F>
  void for_each(F&& f) const {
    f("turn", turn);
    f("shift", shift);
  }
};
using Nodes = BasicNodes<float>;

// Zeros in the shapes of others, on their device.
template <class To, class From>
BasicNodes<To> zeros_like(const BasicNodes<From>& nodes) {
  const Device device = nodes.device();
  return {Tensor<int32_t>(nodes.body.shape(), device), Tensor<To>(nodes.time.shape(), device),
          Tensor<To>(nodes.centre.shape(), device),    Tensor<To>(nodes.radius.shape(), device),
          Tensor<To>(nodes.turn.shape(), device),      Tensor<To>(nodes.shift.shape(), device),
          Tensor<To>(nodes.anchor.shape(), device)};
}
template <class To, class From>
BasicNodes<To> convert(const BasicNodes<From>& nodes) {
  return {nodes.body,
          convert<To>(nodes.time),
          convert<To>(nodes.centre),
          convert<To>(nodes.radius),
          convert<To>(nodes.turn),
          convert<To>(nodes.shift),
          convert<To>(nodes.anchor)};
}

}  // namespace traceflow
