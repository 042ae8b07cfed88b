#include "base/kernel.h"
#include "train/density_kernels.h"

namespace traceflow {

template void cuda::for_each_index(const char*, int64_t, const AccumulateSignal&);
template void cuda::for_each_index(const char*, int64_t, const ScatterChild&);
template void cuda::for_each_index(const char*, int64_t, const ShareOpacity&);
template void cuda::for_each_index(const char*, int64_t, const ShortenNeedle&);
template void cuda::for_each_index(const char*, int64_t, const ShortenUnseen&);
template void cuda::for_each_index(const char*, int64_t, const LowerTo&);

}  // namespace traceflow
