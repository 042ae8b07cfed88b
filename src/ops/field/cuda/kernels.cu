#include "base/kernel.h"
#include "ops/field/cuda/kernels.h"

namespace traceflow {

using field::device::AddBiasAndRelu;
using field::device::Encode;
using field::device::LoadGradient;
using field::device::MaskByActivation;
using field::device::Pack;

template void cuda::for_each_index(const char*, int64_t, const Encode<float>&);
template void cuda::for_each_index(const char*, int64_t, const Encode<Bf16>&);
template void cuda::for_each_index(const char*, int64_t, const Pack<float>&);
template void cuda::for_each_index(const char*, int64_t, const Pack<Bf16>&);
template void cuda::for_each_index(const char*, int64_t, const AddBiasAndRelu<float>&);
template void cuda::for_each_index(const char*, int64_t, const AddBiasAndRelu<Bf16>&);
template void cuda::for_each_index(const char*, int64_t, const MaskByActivation<float>&);
template void cuda::for_each_index(const char*, int64_t, const MaskByActivation<Bf16>&);
template void cuda::for_each_index(const char*, int64_t, const LoadGradient<float>&);
template void cuda::for_each_index(const char*, int64_t, const LoadGradient<Bf16>&);
template void cuda::for_each_index(const char*, int64_t, const field::device::FinishOutput&);
template void cuda::for_each_index(const char*, int64_t, const field::device::AddSlots&);

}  // namespace traceflow
