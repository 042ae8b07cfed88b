#include "base/kernel.h"
#include "scene/rows_kernels.h"

namespace traceflow {

template void cuda::for_each_index(const char*, int64_t, const TakeRow<float>&);
template void cuda::for_each_index(const char*, int64_t, const TakeRow<int32_t>&);

}  // namespace traceflow
