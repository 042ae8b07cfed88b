#pragma once

#include <cstdint>

#include "base/tensor.h"

namespace traceflow::trace {

// The hits of one ray while it is traced. Arrays apart, with room for a vector beyond the last.
struct Hits {
  float* distance = nullptr;
  float* alpha = nullptr;
  uint32_t* surfel = nullptr;  // or whatever stands for one
  size_t count = 0;

  void push(float t, float a, uint32_t s) {
    reserve_more(1);
    distance[count] = t;
    alpha[count] = a;
    surfel[count++] = s;
  }
  void reserve_more(size_t more) {
    if (count + more + slack > capacity_) grow(count + more + slack);
  }
  friend void swap(Hits& a, Hits& b) noexcept;

 private:
  static constexpr size_t slack = 16;
  void grow(size_t wanted);

  Tensor<float> distances_, alphas_;
  Tensor<uint32_t> surfels_;
  size_t capacity_ = 0;
};

// Puts hits in order of distance, those of equal distance in order of surfel.
class HitSorter {
 public:
  // Up to so many hits each is placed by counting the ones before it.
  static constexpr size_t most_ranked = 192;

  // Puts each hit at its rank, which is the number of nearer ones. False, and nothing is done, where two hits
  // have one distance and so one rank.
  bool place(const uint32_t* rank, Hits& hits);
  // `names`: the surfel of what each hit names, null where hits name surfels.
  void sort_many(Hits& hits, const uint32_t* names);

 private:
  Hits sorted_;
  Tensor<uint64_t> keys_;
};

}  // namespace traceflow::trace
