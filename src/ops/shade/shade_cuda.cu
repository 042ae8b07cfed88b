#include "base/kernel.h"
#include "ops/shade/shade_kernels.h"

namespace traceflow {

template void cuda::for_each_index(const char*, int64_t, const shade::Blend<float>&);
template void cuda::for_each_index(const char*, int64_t, const shade::BlendBackward<float>&);

}  // namespace traceflow
