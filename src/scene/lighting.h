#pragma once

#include "base/tensor.h"

namespace traceflow {

// How the light on what no body carries changes over time, as where a body's shadow moves over a table: a
// grid of the logarithm of the brightness, in space and time. The logarithm is trilinear between points and
// linear between times; beyond the first time and the last it stands still. It is 0 on the box's faces and
// outside. Also the shape of gradients and of Adam's moments. T is float in the program, double in
// references.
template <class T>
struct BasicLighting {
  Tensor<T> box;   // 2×3, the corners with the lowest and the highest coordinates, scene units. Not trained
  Tensor<T> time;  // L, ascending, in [0, 1]. Not trained
  Tensor<T> brightness;  // L×Z×Y×X, logarithms; Z, Y, X of 3 or more, evenly spaced over the box

  int64_t times() const { return time.size(); }
  int64_t points() const { return times() > 0 ? brightness.size() / times() : 0; }

  Device device() const { return brightness.device(); }
  // The same on a device.
  BasicLighting on(Device device) const { return {box.on(device), time.on(device), brightness.on(device)}; }

  // The shapes of another, on its device, in the memory that is there.
  void resize_like(const BasicLighting& other) {
    const Device device = other.device();
    box.place(device).resize(other.box.shape());
    time.place(device).resize(other.time.shape());
    brightness.place(device).resize(other.brightness.shape());
  }

  // f(name, tensor) for every group that is trained.
  template <class F>
  void for_each(F&& f) {
    f("brightness", brightness);
  }
  template <class F>
  void for_each(F&& f) const {
    f("brightness", brightness);
  }
};
using Lighting = BasicLighting<float>;

// Zeros in the shapes of another, on its device.
template <class To, class From>
BasicLighting<To> zeros_like(const BasicLighting<From>& lighting) {
  const Device device = lighting.device();
  return {Tensor<To>(lighting.box.shape(), device), Tensor<To>(lighting.time.shape(), device),
          Tensor<To>(lighting.brightness.shape(), device)};
}
template <class To, class From>
BasicLighting<To> convert(const BasicLighting<From>& lighting) {
  return {convert<To>(lighting.box), convert<To>(lighting.time), convert<To>(lighting.brightness)};
}

}  // namespace traceflow
