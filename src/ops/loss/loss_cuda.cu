#include "ops/loss/loss_kernels.h"
#include "primitives/sum_kernels.h"

namespace traceflow {

using loss::MeanOver;
using loss::MeanOverCounted;

template void cuda::sum_each_index<double>(const char*, int64_t, const loss::L1&, const MeanOver&);
template void cuda::sum_each_index<double>(const char*, int64_t, const loss::SquaredError&, const MeanOver&);
template void cuda::sum_each_index<CountedSum>(const char*, int64_t, const loss::KnownSquaredError&,
                                               const MeanOverCounted&);
template void cuda::sum_each_index<double>(const char*, int64_t, const loss::Distortion&, const MeanOver&);
template void cuda::sum_each_index<double>(const char*, int64_t, const loss::Silhouette&, const MeanOver&);
template void cuda::sum_each_index<double>(const char*, int64_t, const loss::DepthPrior&, const MeanOver&);
template void cuda::sum_each_index<double>(const char*, int64_t, const loss::RowNorm&, const MeanOver&);
template void cuda::sum_each_index<double>(const char*, int64_t, const loss::NormalConsistency<float>&,
                                           const MeanOver&);
template void cuda::sum_each_index<CountedSum>(const char*, int64_t, const loss::NormalPrior<float>&,
                                               const MeanOverCounted&);
template void cuda::for_each_index(const char*, int64_t, const loss::NormalPriorBackward<float>&);

}  // namespace traceflow
