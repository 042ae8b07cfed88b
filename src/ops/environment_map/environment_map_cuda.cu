#include "base/kernel.h"
#include "ops/environment_map/environment_map_kernels.h"

namespace traceflow {

template void cuda::for_each_index(const char*, int64_t, const environment_map::LookUp<float>&);
template void cuda::for_each_index(const char*, int64_t, const environment_map::BackwardByRay<float>&);
template void cuda::for_each_index(const char*, int64_t, const environment_map::BackwardByTexel<float>&);

}  // namespace traceflow
