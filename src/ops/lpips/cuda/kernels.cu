#include "ops/lpips/cuda/kernels.h"
#include "primitives/sum_kernels.h"

namespace traceflow {

using namespace lpips::device;

template void cuda::for_each_index(const char*, int64_t, const PadWeights&);
template void cuda::for_each_index(const char*, int64_t, const GatherPatches&);
template void cuda::for_each_index(const char*, int64_t, const AddBiasAndRelu&);
template void cuda::for_each_index(const char*, int64_t, const KeepGates&);
template void cuda::for_each_index(const char*, int64_t, const Halve&);
template void cuda::for_each_index(const char*, int64_t, const HalveBackward&);
template void cuda::for_each_index(const char*, int64_t, const AddPatches&);
template void cuda::for_each_index(const char*, int64_t, const AddGradient&);
template void cuda::sum_each_index<double>(const char*, int64_t, const ScaleImages&, const BeginDistance&);
template void cuda::sum_each_index<double>(const char*, int64_t, const Load&, const AddToDistance&);
template void cuda::sum_each_index<double>(const char*, int64_t, const CheckGradient&,
                                           const StoreSum<double>&);

}  // namespace traceflow
