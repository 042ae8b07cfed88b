#include "base/kernel.h"
#include "primitives/list_where.h"
#include "primitives/sum_kernels.h"
#include "render/frame_kernels.h"

namespace traceflow {

template void cuda::sum_each_index<LargestSquare>(const char*, int64_t, const SquareOfMove&, const KeepRoot&);
template void cuda::for_each_index(const char*, int64_t, const AddNumbers&);
template void cuda::for_each_index(const char*, int64_t, const PlaceSignal&);
template void cuda::for_each_index(const char*, int64_t, const IsCarried&);
template void cuda::for_each_index(const char*, int64_t, const FlagNonZero&);
template void cuda::for_each_index(const char*, int64_t, const FollowReach&);
template void cuda::for_each_index(const char*, int64_t, const FlagWhere<CanShow>&);

}  // namespace traceflow
