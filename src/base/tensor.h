#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <new>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include "base/device.h"
#include "base/error.h"

namespace traceflow {

// Up to four dimensions, row-major: the last index runs fastest.
class Shape {
 public:
  Shape() = default;
  Shape(std::initializer_list<int64_t> dims) : rank_(static_cast<int>(dims.size())) {
    require(dims.size() <= 4, "a shape has at most 4 dimensions");
    std::copy(dims.begin(), dims.end(), dims_.begin());
  }
  int rank() const { return rank_; }
  int64_t operator[](int i) const { return dims_[static_cast<size_t>(i)]; }
  // Product of all dimensions; 0 for the empty shape.
  int64_t elements() const;
  std::string to_string() const;
  friend bool operator==(const Shape&, const Shape&) = default;

 private:
  std::array<int64_t, 4> dims_{};
  int rank_ = 0;
};

// A contiguous row-major array that owns its memory (64-byte aligned) and knows its device. Copies are deep.
// T is a plain number. resize() keeps the allocation where it is large enough, so a tensor kept across
// iterations stops allocating; the content after resize() is unspecified.
template <class T>
class Tensor {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Tensor() = default;
  explicit Tensor(const Shape& shape, Device device = Device::cpu) : device_(device) {
    resize(shape);
    zero();
  }
  Tensor(const Tensor& other) : device_(other.device_) { *this = other; }
  // A tensor that was moved from is empty.
  Tensor(Tensor&& other) noexcept { swap(other); }
  Tensor& operator=(const Tensor& other) {
    if (this == &other) return *this;
    resize(other.shape_);
    std::copy(other.data(), other.data() + other.size(), data());
    return *this;
  }
  Tensor& operator=(Tensor&& other) noexcept {
    Tensor taken(std::move(other));
    swap(taken);
    return *this;
  }
  ~Tensor() = default;

  const Shape& shape() const { return shape_; }
  int64_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  int64_t dim(int i) const { return shape_[i]; }
  Device device() const { return device_; }

  T* data() { return memory_.get(); }
  const T* data() const { return memory_.get(); }
  std::span<T> values() { return {data(), static_cast<size_t>(size_)}; }
  std::span<const T> values() const { return {data(), static_cast<size_t>(size_)}; }
  // First element of row i, a row being everything but the first index.
  T* row(int64_t i) { return data() + i * row_size(); }
  const T* row(int64_t i) const { return data() + i * row_size(); }
  int64_t row_size() const { return shape_.rank() == 0 || shape_[0] == 0 ? 0 : size_ / shape_[0]; }

  T& operator[](int64_t i) { return memory_.get()[i]; }
  const T& operator[](int64_t i) const { return memory_.get()[i]; }
  T& operator()(int64_t i, int64_t j) { return memory_.get()[i * shape_[1] + j]; }
  const T& operator()(int64_t i, int64_t j) const { return memory_.get()[i * shape_[1] + j]; }
  T& operator()(int64_t i, int64_t j, int64_t k) {
    return memory_.get()[(i * shape_[1] + j) * shape_[2] + k];
  }
  const T& operator()(int64_t i, int64_t j, int64_t k) const {
    return memory_.get()[(i * shape_[1] + j) * shape_[2] + k];
  }

  void resize(const Shape& shape) {
    const int64_t wanted = shape.elements();
    if (wanted > capacity_) {
      memory_.reset(static_cast<T*>(::operator new(static_cast<size_t>(wanted) * sizeof(T), alignment)));
      capacity_ = wanted;
    }
    shape_ = shape;
    size_ = wanted;
  }
  // resize() and fill with zeros.
  void reset(const Shape& shape) {
    resize(shape);
    zero();
  }
  void fill(T value) { std::fill(data(), data() + size_, value); }
  void zero() { fill(T{}); }

  void swap(Tensor& other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(shape_, other.shape_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    std::swap(device_, other.device_);
  }

 private:
  static constexpr std::align_val_t alignment{64};
  struct Free {
    void operator()(T* p) const { ::operator delete(p, alignment); }
  };
  std::unique_ptr<T, Free> memory_;
  Shape shape_;
  int64_t size_ = 0;
  int64_t capacity_ = 0;
  Device device_ = Device::cpu;
};

// The same numbers in another scalar type, e.g. to hand float parameters to a double-precision reference.
template <class To, class From>
Tensor<To> convert(const Tensor<From>& from) {
  Tensor<To> to(from.shape());
  std::transform(from.data(), from.data() + from.size(), to.data(),
                 [](From v) { return static_cast<To>(v); });
  return to;
}

}  // namespace traceflow
