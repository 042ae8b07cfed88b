#include "base/kernel.h"
#include "ops/deform/deform_kernels.h"
#include "primitives/list_where.h"

namespace traceflow {

template void cuda::for_each_index(const char*, int64_t, const FlagWhere<deform::IsMovedByField>&);
template void cuda::for_each_index(const char*, int64_t, const deform::Gather&);
template void cuda::for_each_index(const char*, int64_t, const deform::SpreadResiduals&);
template void cuda::for_each_index(const char*, int64_t, const deform::CollectResiduals&);
template void cuda::for_each_index(const char*, int64_t, const deform::PoseSh&);
template void cuda::for_each_index(const char*, int64_t, const deform::Pose&);
template void cuda::for_each_index(const char*, int64_t, const deform::Displace&);
template void cuda::for_each_index(const char*, int64_t, const deform::PoseShBackward&);
template void cuda::for_each_index(const char*, int64_t, const deform::PoseBackward&);

}  // namespace traceflow
