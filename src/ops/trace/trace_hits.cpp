#include "ops/trace/trace_hits.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace traceflow::trace {

namespace {

template <class T>
void grow_tensor(Tensor<T>& tensor, size_t capacity, size_t used) {
  Tensor<T> larger;
  larger.resize({static_cast<int64_t>(capacity)});
  std::copy_n(tensor.data(), used, larger.data());
  tensor = std::move(larger);
}

uint32_t name(const Hits& hits, size_t i, const uint32_t* names) {
  return names ? names[hits.surfel[i]] : hits.surfel[i];
}

void order_ties(Hits& hits, size_t begin, size_t end, const uint32_t* names) {
  for (size_t i = begin + 1; i < end; ++i) {
    for (size_t j = i; j > begin && name(hits, j, names) < name(hits, j - 1, names); --j) {
      std::swap(hits.surfel[j], hits.surfel[j - 1]);
      std::swap(hits.alpha[j], hits.alpha[j - 1]);
    }
  }
}

}  // namespace

void Hits::grow(size_t wanted) {
  const size_t used = count;
  capacity_ = std::max(wanted, 2 * capacity_);
  grow_tensor(distances_, capacity_, used);
  grow_tensor(alphas_, capacity_, used);
  grow_tensor(surfels_, capacity_, used);
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

void HitSorter::place(const uint32_t* rank, Hits& hits, const uint32_t* names) {
  sorted_.count = 0;
  sorted_.reserve_more(hits.count);
  for (size_t i = 0; i < hits.count; ++i) {
    const uint32_t to = rank[i];
    sorted_.distance[to] = hits.distance[i];
    sorted_.alpha[to] = hits.alpha[i];
    sorted_.surfel[to] = hits.surfel[i];
  }
  sorted_.count = hits.count;
  swap(sorted_, hits);
  for (size_t begin = 0; begin + 1 < hits.count;) {
    size_t end = begin + 1;
    while (end < hits.count && hits.distance[end] == hits.distance[begin]) ++end;
    if (end - begin > 1) order_ties(hits, begin, end, names);
    begin = end;
  }
}

// Distances are not negative, so their bits order as they do.
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
