#include "base/kernel.h"
#include "ops/surface/surface_kernels.h"
#include "primitives/list_where.h"
#include "primitives/sum_kernels.h"

namespace traceflow {

using surface::CameraSum;

template void cuda::for_each_index(const char*, int64_t, const surface::PseudoNormals<float>&);
template void cuda::for_each_index(const char*, int64_t, const surface::PseudoNormalsBackward<float>&);
template void cuda::sum_each_index<CameraSum<float>>(const char*, int64_t,
                                                     const surface::PseudoNormalsBackward<float>&,
                                                     const StoreSum<CameraSum<float>>&);
template void cuda::for_each_index(const char*, int64_t, const surface::ReflectionRays<float>&);
template void cuda::for_each_index(const char*, int64_t, const surface::ReflectionRaysBackward<float>&);
template void cuda::sum_each_index<CameraSum<float>>(const char*, int64_t,
                                                     const surface::ReflectionRaysBackward<float>&,
                                                     const StoreSum<CameraSum<float>>&);
template void cuda::for_each_index(const char*, int64_t, const FlagWhere<surface::IsTraced>&);
template void cuda::for_each_index(const char*, int64_t, const surface::ListedWeight&);

}  // namespace traceflow
