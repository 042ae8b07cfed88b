#include "base/kernel.h"
#include "ops/lighting/lighting_kernels.h"
#include "primitives/sum_kernels.h"

namespace traceflow {

template void cuda::for_each_index(const char*, int64_t, const lighting::LightSurfel&);
template void cuda::for_each_index(const char*, int64_t, const lighting::LightBack&);
template void cuda::for_each_index(const char*, int64_t, const lighting::CollectAtPoint&);
template void cuda::for_each_index(const char*, int64_t, const lighting::ResistAlongRow&);
template void cuda::for_each_index(const char*, int64_t, const lighting::ResistOnBody&);
template void cuda::sum_each_index<lighting::BodyGradient>(const char*, int64_t,
                                                           const lighting::BodyGradientOfSurfel&,
                                                           const lighting::AddBodyGradient&);

}  // namespace traceflow
