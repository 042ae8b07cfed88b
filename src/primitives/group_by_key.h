#pragma once

#include <cstdint>

#include "base/tensor.h"

namespace traceflow::cuda {

// Items listed by key, on the CUDA device: those with key k are entry[begin[k]] to entry[begin[k + 1] − 1],
// in ascending order. Keeps its memory between uses.
struct KeyGroups {
  Tensor<int32_t> begin;  // number of keys + 1
  Tensor<int32_t> entry;
  Tensor<int32_t> filled;
  Tensor<uint8_t> scratch;
};

// Lists 0 to n − 1 by their keys, which are below `keys`; items with a negative key are in no list. The lists
// are the same in every run, so that contributions to a key can be summed in order, without atomic sums.
TRACEFLOW_WITH_CUDA void group_by_key(const int32_t* key, int64_t n, int64_t keys, KeyGroups& lists);

}  // namespace traceflow::cuda
