#include "base/kernel.h"
#include "capture/pixels_kernels.h"

namespace traceflow {

template void cuda::for_each_index(const char*, int64_t, const WidenColour&);
template void cuda::for_each_index(const char*, int64_t, const TakeUnknown&);
template void cuda::for_each_index(const char*, int64_t, const LeaveUnknown&);
template void cuda::for_each_index(const char*, int64_t, const WidenNormal&);

}  // namespace traceflow
