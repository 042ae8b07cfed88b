#pragma once

#include "base/tensor.h"

namespace traceflow {

// How light changes over time. For surfels of no body, such as a table that a body's shadow crosses, it is a
// grid of the logarithm of the brightness, in space and time. The logarithm is trilinear between points, and
// 0 on the faces of the box and outside. On a body, which turns in the light and passes lamps, it is a
// logarithm that is linear in space, b₀ + b · (p − m)/r with the body's centre m and radius r. At a fixed
// time it approximates Lambertian reflection of distant light. Everything is linear between times, and
// constant before the first and after the last. Also holds gradients and Adam's moments. T is float in the
// program, double in references.
template <class T>
struct BasicLighting {
  Tensor<T> box;   // 2×3, the corners with the lowest and the highest coordinates, scene units. Not trained
  Tensor<T> time;  // L, ascending, in [0, 1]. Not trained
  Tensor<T> brightness;  // L×Z×Y×X, logarithms; Z, Y, X of 3 or more, evenly spaced over the box
  // For each of B bodies; all are empty if the light on bodies is constant.
  Tensor<T> centre;           // B×L×3, where the body is, scene units. Not trained
  Tensor<T> radius;           // B, scene units, above 0. Not trained
  Tensor<T> body_brightness;  // B×L×4: b₀, and b along the axes of the world

  int64_t times() const { return time.size(); }
  int64_t points() const { return times() > 0 ? brightness.size() / times() : 0; }
  int64_t bodies() const { return radius.size(); }

  Device device() const { return brightness.device(); }
  // A copy on a device.
  BasicLighting on(Device device) const {
    return {box.on(device),    time.on(device),   brightness.on(device),
            centre.on(device), radius.on(device), body_brightness.on(device)};
  }

  // Takes the shapes and the device of another, and reuses the memory.
  void resize_like(const BasicLighting& other) {
    const Device device = other.device();
    box.place(device).resize(other.box.shape());
    time.place(device).resize(other.time.shape());
    brightness.place(device).resize(other.brightness.shape());
    centre.place(device).resize(other.centre.shape());
    radius.place(device).resize(other.radius.shape());
    body_brightness.place(device).resize(other.body_brightness.shape());
  }

  // Calls f(name, tensor) for every group that is trained.
  template <class F>
  void for_each(F&& f) {
    f("brightness", brightness);
    f("body_brightness", body_brightness);
  }
  template <class F>
  void for_each(F&& f) const {
    f("brightness", brightness);
    f("body_brightness", body_brightness);
  }
};
using Lighting = BasicLighting<float>;

// Zeros in the shapes of another, on its device.
template <class To, class From>
BasicLighting<To> zeros_like(const BasicLighting<From>& lighting) {
  const Device device = lighting.device();
  const auto zeros = [&](const Tensor<From>& like) { return Tensor<To>(like.shape(), device); };
  return {zeros(lighting.box),    zeros(lighting.time),   zeros(lighting.brightness),
          zeros(lighting.centre), zeros(lighting.radius), zeros(lighting.body_brightness)};
}
template <class To, class From>
BasicLighting<To> convert(const BasicLighting<From>& lighting) {
  return {convert<To>(lighting.box),    convert<To>(lighting.time),   convert<To>(lighting.brightness),
          convert<To>(lighting.centre), convert<To>(lighting.radius), convert<To>(lighting.body_brightness)};
}

}  // namespace traceflow
