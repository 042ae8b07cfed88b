#include "primitives/group_by_key.h"

#include "base/kernel.h"
#include "primitives/list_where.h"
#include "primitives/sort.h"

// Counts the entries of every key, sums the counts to offsets, fills the lists in the order in which threads
// arrive, and sorts each list with one thread, since lists are short.
namespace traceflow::cuda {

namespace {

constexpr int list_threads = 256;

__device__ int64_t this_thread() { return int64_t{blockIdx.x} * list_threads + threadIdx.x; }

__global__ void count_keys(int64_t n, const int32_t* key, int32_t* count) {
  const int64_t i = this_thread();
  if (i < n && key[i] >= 0) atomicAdd(&count[key[i]], 1);
}

__global__ void fill_lists(int64_t n, const int32_t* key, const int32_t* begin, int32_t* filled,
                           int32_t* entry) {
  const int64_t i = this_thread();
  if (i < n && key[i] >= 0) entry[begin[key[i]] + atomicAdd(&filled[key[i]], 1)] = static_cast<int32_t>(i);
}

// Restores a heap of n, largest on top, in which only the entry at `at` may be too small.
__device__ void sift_down(int32_t* heap, int32_t n, int32_t at) {
  const int32_t value = heap[at];
  for (int32_t child = 2 * at + 1; child < n; child = 2 * at + 1) {
    if (child + 1 < n && heap[child + 1] > heap[child]) ++child;
    if (heap[child] <= value) break;
    heap[at] = heap[child];
    at = child;
  }
  heap[at] = value;
}

__global__ void sort_lists(int64_t keys, const int32_t* begin, int32_t* entry) {
  const int64_t k = this_thread();
  if (k >= keys) return;
  int32_t* const list = entry + begin[k];
  const int32_t n = begin[k + 1] - begin[k];
  for (int32_t at = n / 2 - 1; at >= 0; --at) sift_down(list, n, at);
  for (int32_t last = n - 1; last > 0; --last) {
    const int32_t largest = list[0];
    list[0] = list[last];
    list[last] = largest;
    sift_down(list, last, 0);
  }
}

}  // namespace

void group_by_key(const int32_t* key, int64_t n, int64_t keys, KeyGroups& lists) {
  lists.begin.place(Device::cuda).reset({keys + 1});
  lists.filled.place(Device::cuda).reset({keys});
  lists.entry.place(Device::cuda).resize({n});
  int32_t* const begin = lists.begin.data();
  launch("lists: count", {blocks_for(n, list_threads), list_threads}, count_keys, n, key, begin);
  exclusive_sum(begin, begin, keys + 1, lists.scratch);
  launch("lists: fill", {blocks_for(n, list_threads), list_threads}, fill_lists, n, key, begin,
         lists.filled.data(), lists.entry.data());
  launch("lists: sort", {blocks_for(keys, list_threads), list_threads}, sort_lists, keys, begin,
         lists.entry.data());
}

template void for_each_index(const char*, int64_t, const PutFlagged&);

}  // namespace traceflow::cuda
