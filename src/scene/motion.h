#pragma once

#include "base/tensor.h"

namespace traceflow {

// How B rigid bodies of a set of surfels move: each has a pose at each of K times (keys). At time t a point x
// of body b is at R_b(t) (x − c_b) + c_b + s_b(t). Between two keys the rotation turns at a constant rate
// about one axis, and the shift is linear; before the first key and after the last both are constant. Also
// holds gradients and Adam's moments. T is float in the program, double in references.
template <class T>
struct BasicMotion {
  Tensor<T> time;      // K, ascending, in [0, 1]
  Tensor<T> centre;    // B×3, the point that a body rotates about, at rest; scene units. Not trained
  Tensor<T> rotation;  // B×K×4, quaternion (w, x, y, z), any length
  Tensor<T> shift;     // B×K×3, scene units

  int64_t bodies() const { return centre.empty() ? 0 : centre.dim(0); }
  int64_t keys() const { return time.size(); }

  Device device() const { return centre.device(); }
  // A copy on a device.
  BasicMotion on(Device device) const {
    return {time.on(device), centre.on(device), rotation.on(device), shift.on(device)};
  }

  // Takes the shapes and the device of another motion, and reuses the memory.
  void resize_like(const BasicMotion& other) {
    const Device device = other.device();
    time.place(device).resize(other.time.shape());
    centre.place(device).resize(other.centre.shape());
    rotation.place(device).resize(other.rotation.shape());
    shift.place(device).resize(other.shift.shape());
  }

  // Calls f(name, tensor) for every group that is trained.
  template <class F>
  void for_each(F&& f) {
    f("rotation", rotation);
    f("shift", shift);
  }
  template <class F>
  void for_each(F&& f) const {
    f("rotation", rotation);
    f("shift", shift);
  }
};
using Motion = BasicMotion<float>;

// Bodies that are at rest at their centres (B×3) at each of the times (K).
inline Motion still_motion(const Tensor<float>& centre, const Tensor<float>& time) {
  const int64_t bodies = centre.dim(0), keys = time.size();
  Motion motion{time, centre, Tensor<float>({bodies, keys, 4}), Tensor<float>({bodies, keys, 3})};
  for (int64_t i = 0; i < motion.rotation.size(); i += 4) motion.rotation[i] = 1;
  return motion;
}

// Zeros in the shapes of another motion, on its device.
template <class To, class From>
BasicMotion<To> zeros_like(const BasicMotion<From>& motion) {
  const Device device = motion.device();
  return {Tensor<To>(motion.time.shape(), device), Tensor<To>(motion.centre.shape(), device),
          Tensor<To>(motion.rotation.shape(), device), Tensor<To>(motion.shift.shape(), device)};
}
template <class To, class From>
BasicMotion<To> convert(const BasicMotion<From>& motion) {
  return {convert<To>(motion.time), convert<To>(motion.centre), convert<To>(motion.rotation),
          convert<To>(motion.shift)};
}

}  // namespace traceflow
