#pragma once

#include <string>

#include "base/tensor.h"
#include "scene/surfel_fields.h"

namespace traceflow {

// Values of `body` for surfels of no body: the field may move it, or it is static.
inline constexpr int32_t moved_by_field = -1, motionless = -2;

// A set of N surfels as stored and trained, before activation (method §1.1). Also holds gradients and Adam's
// moments. T is float in the program, double in references.
template <class T>
struct BasicSurfels {
  Tensor<T> position;       // N×3, world (normalised scene units)
  Tensor<T> log_scale;      // N×2, log of the standard deviations along t_u, t_v
  Tensor<T> rotation;       // N×4, quaternion (w, x, y, z), any length
  Tensor<T> opacity_logit;  // N
  Tensor<T> sh;             // N×K×3, spherical harmonics, K = (degree + 1)²
  Tensor<T> tint_logit;     // N, specular tint; empty for the environment
  // N, the body of the surfel (scene/motion.h), or one of the two values above; empty if there are no bodies.
  // Not trained: gradients and moments have none.
  Tensor<int32_t> body{};
  Tensor<T> roughness_logit{};  // N, of its reflection; empty: all mirrors are perfect, or nothing reflects

  int64_t count() const { return position.empty() ? 0 : position.dim(0); }
  bool has_tint() const { return !tint_logit.empty(); }
  bool has_roughness() const { return !roughness_logit.empty(); }

  Device device() const { return position.device(); }
  // A copy on a device.
  BasicSurfels on(Device device) const {
    BasicSurfels result;
    for_each_field([&](const SurfelField&, const Tensor<T>& from, Tensor<T>& to) { to = from.on(device); },
                   *this, result);
    result.body = body.on(device);
    return result;
  }

  // Takes the shapes and the device of another set, and reuses the memory.
  void resize_like(const BasicSurfels& other) {
    for_each_field([&](const SurfelField&, const Tensor<T>& like,
                       Tensor<T>& field) { field.place(other.device()).resize(like.shape()); },
                   other, *this);
  }

  // Calls f(name, tensor) for each field that the set has, in the order of for_each_field.
  template <class F>
  void for_each(F&& f) {
    visit(*this, f);
  }
  template <class F>
  void for_each(F&& f) const {
    visit(*this, f);
  }

 private:
  template <class Self, class F>
  static void visit(Self& self, F&& f) {
    for_each_field(
        [&](const SurfelField& field, auto& tensor) {
          if (!field.is_optional || !tensor.empty()) f(std::string(field.name), tensor);
        },
        self);
  }
};
using Surfels = BasicSurfels<float>;

// M surfels at one time, activated (method §1.3): the input of the rasteriser and the tracer. They are a
// subset of the stored ones in ascending order. Also holds the gradients by these values.
template <class T>
struct BasicPosedSurfels {
  Tensor<T> position;  // M×3, world
  Tensor<T> scale;     // M×2, standard deviations, > 0
  Tensor<T> rotation;  // M×4, quaternion (w, x, y, z), any length: users normalise it (math/rotation.h)
  Tensor<T> opacity;   // M, in (0, 1)
  Tensor<T> sh;        // M×K×3, only the degrees in use: K = (active degree + 1)²
  Tensor<T> tint;      // M, in (0, 1); empty for the environment
  Tensor<T> in_body;   // M, 1 if the surfel belongs to a body, otherwise 0; empty if no silhouette is drawn.
                       // Has no gradient
  // M, in (0, ¼): standard deviation, as a tangent, of the directions that a surfel reflects a ray into
  // (method §4.5); empty if all are 0.
  Tensor<T> roughness{};

  int64_t count() const { return position.empty() ? 0 : position.dim(0); }
  bool has_tint() const { return !tint.empty(); }
  bool has_roughness() const { return !roughness.empty(); }

  Device device() const { return position.device(); }
  // A copy on a device.
  BasicPosedSurfels on(Device device) const {
    return {position.on(device), scale.on(device), rotation.on(device), opacity.on(device),
            sh.on(device),       tint.on(device),  in_body.on(device),  roughness.on(device)};
  }

  // Sets zeros in the shapes of another set, on its device, to start a gradient. Without `in_body`.
  template <class U>
  void reset_like(const BasicPosedSurfels<U>& other) {
    const Device device = other.device();
    position.place(device).reset(other.position.shape());
    scale.place(device).reset(other.scale.shape());
    rotation.place(device).reset(other.rotation.shape());
    opacity.place(device).reset(other.opacity.shape());
    sh.place(device).reset(other.sh.shape());
    tint.place(device).reset(other.tint.shape());
    roughness.place(device).reset(other.roughness.shape());
  }
};
using PosedSurfels = BasicPosedSurfels<float>;

// Zeros in the shapes of another set, on its device.
template <class To, class From>
BasicSurfels<To> zeros_like(const BasicSurfels<From>& s) {
  BasicSurfels<To> result;
  for_each_field([&](const SurfelField&, const Tensor<From>& like,
                     Tensor<To>& to) { to = Tensor<To>(like.shape(), s.device()); },
                 s, result);
  return result;
}
template <class To, class From>
BasicSurfels<To> convert(const BasicSurfels<From>& s) {
  BasicSurfels<To> result;
  for_each_field(
      [&](const SurfelField&, const Tensor<From>& from, Tensor<To>& to) { to = convert<To>(from); }, s,
      result);
  result.body = s.body;
  return result;
}
template <class To, class From>
BasicPosedSurfels<To> convert(const BasicPosedSurfels<From>& s) {
  return {convert<To>(s.position), convert<To>(s.scale), convert<To>(s.rotation), convert<To>(s.opacity),
          convert<To>(s.sh),       convert<To>(s.tint),  convert<To>(s.in_body),  convert<To>(s.roughness)};
}

}  // namespace traceflow
