#pragma once

#include <cstdint>
#include <limits>

#include "base/parallel.h"
#include "base/tensor.h"
#include "primitives/sort.h"

namespace traceflow {

// 1 where f holds. The entry after the last is 0, so that the running sum ends with the count.
template <class F>
struct FlagWhere {
  F f;
  int64_t n;
  int32_t* flag;
  TRACEFLOW_HD void operator()(int64_t i) const { flag[i] = i < n && f(i) ? 1 : 0; }
};

// Writes every flagged i to its place, the number of flagged ones before it.
struct PutFlagged {
  const int32_t* place;  // number of items + 1 entries
  int32_t* list;
  TRACEFLOW_HD void operator()(int64_t i) const {
    if (place[i] != place[i + 1]) list[place[i]] = static_cast<int32_t>(i);
  }
};

// Lists, ascending, those i of [0, n) for which f(i) holds, on any device. f is a functor as for
// parallel_for; the .cu file beside it instantiates for_each_index for FlagWhere<F>. The list reserves room
// for all, so that its memory does not move whatever the count. The host waits for the count, since it is the
// size of later work.
template <class F>
void list_where(Device device, const char* description, int64_t n, const F& f, Tensor<int32_t>& list) {
  static thread_local Tensor<int32_t> place;
  require(n < std::numeric_limits<int32_t>::max(), "listed things are counted in 32 bits", description);
  place.place(device).resize({n + 1});
  list.place(device).resize({n});
  parallel_for(device, description, n + 1, FlagWhere<F>{f, n, place.data()});
  int32_t count = 0;
  if (device == Device::cpu) {
    for (int64_t i = 0; i < n; ++i) {
      if (place[i] != 0) list[count++] = static_cast<int32_t>(i);
    }
  } else {
    static thread_local Tensor<uint8_t> scratch;
    cuda::exclusive_sum(place.data(), place.data(), n + 1, scratch);
    parallel_for(device, "list: put", n, PutFlagged{place.data(), list.data()});
    memory::copy(Device::cpu, &count, device, place.data() + n, sizeof(count));
  }
  list.resize({count});
}

}  // namespace traceflow
