#include "base/kernel.h"
#include "ops/motion/nodes_kernels.h"
#include "primitives/sum_kernels.h"

namespace traceflow {

template void cuda::for_each_index(const char*, int64_t, const nodes::PoseNode&);
template void cuda::for_each_index(const char*, int64_t, const nodes::BendSurfel&);
template void cuda::for_each_index(const char*, int64_t, const nodes::TurnGradient&);
template void cuda::for_each_index(const char*, int64_t, const nodes::AddToKeys&);
template void cuda::for_each_index(const char*, int64_t, const nodes::BendGradientBack&);
template void cuda::for_each_index(const char*, int64_t, const nodes::ResistanceGradient&);
template void cuda::for_each_index(const char*, int64_t, const nodes::HoldFirst&);
template void cuda::sum_each_index<nodes::NodeGradient>(const char*, int64_t,
                                                        const nodes::NodeGradientOfSurfel&,
                                                        const StoreSum<nodes::NodeGradient>&);

}  // namespace traceflow
