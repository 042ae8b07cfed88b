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
#include <vector>

#include "base/device_memory.h"
#include "base/error.h"

namespace traceflow {

// Up to four dimensions, row-major: the last index varies fastest.
class Shape {
 public:
  Shape() = default;
  Shape(std::initializer_list<int64_t> dims) : Shape(std::span(dims.begin(), dims.size())) {}
  explicit Shape(std::span<const int64_t> dims) : rank_(static_cast<int>(dims.size())) {
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

// A contiguous row-major array that owns its memory (64-byte aligned) on a device. Copies are deep and on the
// same device. T is a plain number, or a struct of such. resize() keeps the allocation if it is large enough,
// so a tensor kept across iterations stops allocating; the content after resize() is unspecified. The host
// may read and write elements only if the device is the CPU; otherwise data() is an address for kernels.
template <class T>
class Tensor {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Tensor() = default;
  explicit Tensor(const Shape& shape, Device device = Device::cpu) : memory_(nullptr, Free{device}) {
    resize(shape);
    zero();
  }
  Tensor(const Tensor& other) { *this = other; }
  // A moved-from tensor is empty.
  Tensor(Tensor&& other) noexcept { swap(other); }
  Tensor& operator=(const Tensor& other) {
    if (this != &other) copy_from(other, other.device());
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
  Device device() const { return memory_.get_deleter().device; }

  // A copy on a device.
  Tensor on(Device device) const {
    Tensor result;
    result.copy_from(*this, device);
    return result;
  }
  // Changes the device and drops the content, for tensors that are about to be resized and written. Keeps the
  // memory if the device is the same.
  Tensor& place(Device device) {
    if (device != this->device()) *this = Tensor(Memory(nullptr, Free{device}));
    return *this;
  }

  T* data() { return memory_.get(); }
  const T* data() const { return memory_.get(); }
  std::span<T> values() { return {data(), static_cast<size_t>(size_)}; }
  std::span<const T> values() const { return {data(), static_cast<size_t>(size_)}; }
  // First element of row i; a row is everything but the first index.
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
      const Device device = this->device();
      const int64_t capacity = grown_capacity(wanted);
      memory_.reset();  // first, so that both are never allocated at once
      shape_ = Shape();
      size_ = capacity_ = 0;
      const size_t bytes = static_cast<size_t>(capacity) * sizeof(T);
      memory_ = Memory(static_cast<T*>(memory::allocate(device, bytes)), Free{device, bytes});
      capacity_ = capacity;
    }
    shape_ = shape;
    size_ = wanted;
  }
  // resize() and fill with zeros.
  void reset(const Shape& shape) {
    resize(shape);
    zero();
  }
  void fill(T value) {
    require(device() == Device::cpu, "a tensor is filled on the host");
    std::fill(data(), data() + size_, value);
  }
  void zero() { memory::zero(device(), data(), bytes()); }

  void swap(Tensor& other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(shape_, other.shape_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

 private:
  struct Free {
    Device device = Device::cpu;
    size_t bytes = 0;
    void operator()(T* p) const noexcept { memory::release(device, p, bytes); }
  };
  using Memory = std::unique_ptr<T, Free>;

  explicit Tensor(Memory memory) : memory_(std::move(memory)) {}

  size_t bytes() const { return static_cast<size_t>(size_) * sizeof(T); }
  // On the CUDA device allocations are slow, and a list that grew once will grow again: adds a quarter.
  int64_t grown_capacity(int64_t wanted) const {
    return device() == Device::cuda && capacity_ > 0 ? wanted + wanted / 4 : wanted;
  }
  void copy_from(const Tensor& other, Device device) {
    place(device);
    resize(other.shape_);
    memory::copy(device, data(), other.device(), other.data(), bytes());
  }

  Memory memory_;
  Shape shape_;
  int64_t size_ = 0;
  int64_t capacity_ = 0;
};

// A list as a one-dimensional tensor on the CPU.
template <class T>
Tensor<T> tensor_of(const std::vector<T>& list) {
  Tensor<T> tensor(Shape{static_cast<int64_t>(list.size())});
  std::copy(list.begin(), list.end(), tensor.data());
  return tensor;
}

// The tensor itself if it is on the CPU; otherwise a copy of it in `fetched`.
template <class T>
const Tensor<T>& on_host(const Tensor<T>& tensor, Tensor<T>& fetched) {
  if (tensor.device() == Device::cpu) return tensor;
  fetched = tensor.on(Device::cpu);
  return fetched;
}

// Converts to another scalar type, e.g. float parameters for a double-precision reference.
template <class To, class From>
Tensor<To> convert(const Tensor<From>& from) {
  Tensor<To> to(from.shape());
  std::transform(from.data(), from.data() + from.size(), to.data(),
                 [](From v) { return static_cast<To>(v); });
  return to;
}

}  // namespace traceflow
