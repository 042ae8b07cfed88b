#include "base/kernel.h"
#include "ops/motion/motion_kernels.h"
#include "primitives/sum_kernels.h"

namespace traceflow {

template void cuda::for_each_index(const char*, int64_t, const motion::PoseBody&);
template void cuda::for_each_index(const char*, int64_t, const motion::MoveSurfel&);
template void cuda::for_each_index(const char*, int64_t, const motion::AddToKeys&);
template void cuda::for_each_index(const char*, int64_t, const motion::TurnGradientBack&);
template void cuda::for_each_index(const char*, int64_t, const motion::HoldFirstKey&);
template void cuda::for_each_index(const char*, int64_t, const motion::HoldOpacity&);
template void cuda::for_each_index(const char*, int64_t, const motion::SpreadOverKeys&);
template void cuda::sum_each_index<motion::PoseGradient>(const char*, int64_t,
                                                         const motion::PoseGradientOfSurfel&,
                                                         const StoreSum<motion::PoseGradient>&);

}  // namespace traceflow
