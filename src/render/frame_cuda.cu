#include "base/kernel.h"
#include "primitives/list_where.h"
#include "primitives/sum_kernels.h"
#include "render/frame_kernels.h"
#include "render/samples_kernels.h"

namespace traceflow {

template void cuda::sum_each_index<LargestSquare>(const char*, int64_t, const SquareOfMove&, const KeepRoot&);
template void cuda::for_each_index(const char*, int64_t, const AddNumbers&);
template void cuda::for_each_index(const char*, int64_t, const AddBehind&);
template void cuda::for_each_index(const char*, int64_t, const AddBehindBackward&);
template void cuda::for_each_index(const char*, int64_t, const ConeWidths&);
template void cuda::for_each_index(const char*, int64_t, const ConeWidthsBackward&);
template void cuda::for_each_index(const char*, int64_t, const PlaceSignal&);
template void cuda::for_each_index(const char*, int64_t, const IsInBody&);
template void cuda::for_each_index(const char*, int64_t, const FlagNonZero&);
template void cuda::for_each_index(const char*, int64_t, const FollowMaxDisplacement&);
template void cuda::for_each_index(const char*, int64_t, const FlagWhere<CanShow>&);
template void cuda::for_each_index(const char*, int64_t, const AverageSamples&);
template void cuda::for_each_index(const char*, int64_t, const AverageSamplesBackward&);
template void cuda::for_each_index(const char*, int64_t, const AverageDepths&);
template void cuda::for_each_index(const char*, int64_t, const AverageDepthsBackward&);
template void cuda::for_each_index(const char*, int64_t, const AverageMedianDepths&);
template void cuda::for_each_index(const char*, int64_t, const AverageMedianDepthsBackward&);

}  // namespace traceflow
