#pragma once

#include <cstdint>

#include "base/tensor.h"

namespace traceflow::trace {

// The hits of one ray while it is traced. Separate arrays, with room for one vector past the end.
struct Hits {
  float* distance = nullptr;
  float* alpha = nullptr;
  uint32_t* surfel = nullptr;  // or another index of a surfel
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

// Sorts hits by distance, ties by surfel.
class HitSorter {
 public:
  // Up to this many hits are sorted by rank: each is placed by counting the hits before it.
  static constexpr size_t most_ranked = 192;

  // Moves each hit to its rank, the number of nearer hits. Returns false and changes nothing if two hits have
  // the same distance and thus the same rank.
  bool place(const uint32_t* rank, Hits& hits);
  // `names` maps the `surfel` of a hit to a surfel; null if hits store surfels.
  void sort_many(Hits& hits, const uint32_t* names);

 private:
  Hits sorted_;
  Tensor<uint64_t> keys_;
};

}  // namespace traceflow::trace
