#pragma once

#include "base/tensor.h"

namespace traceflow {

// How light changes over time. On what no body carries, as where a body's shadow moves over a table: a grid
// of the logarithm of the brightness, in space and time. The logarithm is trilinear between points; it is 0
// on the box's faces and outside. On a body, which turns in the light and passes lamps: a logarithm that is
// linear in space, b₀ + b · (p − m)/r with the body's middle m and radius r; at a fixed time, Lambert's
// reflection of distant light is much like it. All of it is linear between times; beyond the first time and
// the last it stands still. Also the shape of gradients and of Adam's moments. T is float in the program,
// double in references.
template <class T>
struct BasicLighting {
  Tensor<T> box;   // 2×3, the corners with the lowest and the highest coordinates, scene units. Not trained
  Tensor<T> time;  // L, ascending, in [0, 1]. Not trained
  Tensor<T> brightness;  // L×Z×Y×X, logarithms; Z, Y, X of 3 or more, evenly spaced over the box
  // Of each of B bodies; all are empty where light on bodies does not change.
  Tensor<T> middle;           // B×L×3, where the body is, scene units. Not trained
  Tensor<T> radius;           // B, scene units, above 0. Not trained
  Tensor<T> body_brightness;  // B×L×4: b₀, and b along the axes of the world

  int64_t times() const { return time.size(); }
  int64_t points() const { return times() > 0 ? brightness.size() / times() : 0; }
  int64_t bodies() const { return radius.size(); }

  Device device() const { return brightness.device(); }
  // The same on a device.
  BasicLighting on(Device device) const {
    return {box.on(device),    time.on(device),   brightness.on(device),
            middle.on(device), radius.on(device), body_brightness.on(device)};
  }

  // The shapes of another, on its device, in the memory that is there.
  void resize_like(const BasicLighting& other) {
    const Device device = other.device();
    box.place(device).resize(other.box.shape());
    time.place(device).resize(other.time.shape());
    brightness.place(device).resize(other.brightness.shape());
    middle.place(device).resize(other.middle.shape());
    radius.place(device).resize(other.radius.shape());
    body_brightness.place(device).resize(other.body_brightness.shape());
  }

  // f(name, tensor) for every group that is trained.
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
          zeros(lighting.middle), zeros(lighting.radius), zeros(lighting.body_brightness)};
}
template <class To, class From>
BasicLighting<To> convert(const BasicLighting<From>& lighting) {
  return {convert<To>(lighting.box),    convert<To>(lighting.time),   convert<To>(lighting.brightness),
          convert<To>(lighting.middle), convert<To>(lighting.radius), convert<To>(lighting.body_brightness)};
}

}  // namespace traceflow
