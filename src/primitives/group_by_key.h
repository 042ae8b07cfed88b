#pragma once

#include <cstdint>

#include "base/tensor.h"

namespace traceflow::cuda {

// Things listed by a key, on the CUDA device: those with key k are entry[begin[k]] to entry[begin[k + 1] −
// 1], in ascending order. Keeps its memory for the next time.
struct KeyGroups {
  Tensor<int32_t> begin;  // one more than there are keys
  Tensor<int32_t> entry;
  Tensor<int32_t> filled;
  Tensor<uint8_t> scratch;
};

// Lists 0 to n − 1 by their keys, each under `keys`; a negative key puts a thing into no list. The same lists
// every run: what sends something to a key can be collected there in order, without atomic sums.
TRACEFLOW_WITH_CUDA void group_by_key(const int32_t* key, int64_t n, int64_t keys, KeyGroups& lists);

}  // namespace traceflow::cuda
