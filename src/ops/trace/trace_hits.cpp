#include "ops/trace/trace_hits.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace traceflow::trace {

namespace {

template <class T>
Tensor<T> larger(const Tensor<T>& tensor, size_t capacity, size_t used) {
  Tensor<T> result;
  result.resize({static_cast<int64_t>(capacity)});
  std::copy_n(tensor.data(), used, result.data());
  return result;
}

uint32_t name(const Hits& hits, size_t i, const uint32_t* names) {
  return names ? names[hits.surfel[i]] : hits.surfel[i];
}

}  // namespace

void Hits::grow(size_t wanted) {
  // Allocates everything before it replaces anything, so that hits survive if memory runs out.
  const size_t capacity = std::max(wanted, 2 * capacity_);
  Tensor<float> larger_distances = larger(distances_, capacity, count),
                larger_alphas = larger(alphas_, capacity, count);
  surfels_ = larger(surfels_, capacity, count);
  distances_ = std::move(larger_distances);
  alphas_ = std::move(larger_alphas);
  capacity_ = capacity;
  distance = distances_.data();
  alpha = alphas_.data();
  surfel = surfels_.data();
}

void swap(Hits& a, Hits& b) noexcept {
  std::swap(a.distance, b.distance);
  std::swap(a.alpha, b.alpha);
  std::swap(a.surfel, b.surfel);
  std::swap(a.count, b.count);
  std::swap(a.distances_, b.distances_);
  std::swap(a.alphas_, b.alphas_);
  std::swap(a.surfels_, b.surfels_);
  std::swap(a.capacity_, b.capacity_);
}

// The ranks sum to 0 + 1 + 2 + … if they all differ, and to less otherwise.
bool HitSorter::place(const uint32_t* rank, Hits& hits) {
  const size_t n = hits.count;
  sorted_.count = 0;
  sorted_.reserve_more(n);
  size_t sum = 0;
  for (size_t i = 0; i < n; ++i) {
    const size_t to = rank[i];
    sum += to;
    sorted_.distance[to] = hits.distance[i];
    sorted_.alpha[to] = hits.alpha[i];
    sorted_.surfel[to] = hits.surfel[i];
  }
  if (2 * sum + n != n * n) return false;
  std::copy_n(sorted_.distance, n, hits.distance);
  std::copy_n(sorted_.alpha, n, hits.alpha);
  std::copy_n(sorted_.surfel, n, hits.surfel);
  return true;
}

// Distances are not negative, so their bits have the same order.
void HitSorter::sort_many(Hits& hits, const uint32_t* names) {
  const size_t n = hits.count;
  keys_.resize({static_cast<int64_t>(2 * n)});
  uint64_t* keys = keys_.data();
  struct Keyed {
    uint64_t key;
    uint64_t from;
  };
  auto* keyed = reinterpret_cast<Keyed*>(keys);
  for (size_t i = 0; i < n; ++i) {
    keyed[i] = {uint64_t{std::bit_cast<uint32_t>(hits.distance[i])} << 32 | name(hits, i, names), i};
  }
  std::sort(keyed, keyed + n, [](const Keyed& a, const Keyed& b) { return a.key < b.key; });
  sorted_.count = 0;
  sorted_.reserve_more(n);
  for (size_t i = 0; i < n; ++i) {
    sorted_.distance[i] = hits.distance[keyed[i].from];
    sorted_.alpha[i] = hits.alpha[keyed[i].from];
    sorted_.surfel[i] = hits.surfel[keyed[i].from];
  }
  sorted_.count = n;
  swap(sorted_, hits);
}

}  // namespace traceflow::trace
