#include "eval/metrics_kernels.h"
#include "primitives/sum_kernels.h"

namespace traceflow {

using eval::KeepSum;

template void cuda::for_each_index(const char*, int64_t, const eval::RoundTo8Bit&);
template void cuda::for_each_index(const char*, int64_t, const eval::BothMasks&);
template void cuda::for_each_index(const char*, int64_t, const eval::OtherMask&);
template void cuda::for_each_index(const char*, int64_t, const eval::DepthErrors&);
template void cuda::sum_each_index<CountedSum>(const char*, int64_t, const eval::SquaredError&,
                                               const KeepSum&);
template void cuda::sum_each_index<CountedSum>(const char*, int64_t, const eval::NormalError&,
                                               const KeepSum&);
template void cuda::sum_each_index<CountedSum>(const char*, int64_t, const eval::MeanError&, const KeepSum&);

}  // namespace traceflow
