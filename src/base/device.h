#pragma once

// Marks a function that runs on the host and, when compiled by nvcc, on the device too.
#if defined(__CUDACC__)
#define TRACEFLOW_HD __host__ __device__
#else
#define TRACEFLOW_HD
#endif

// For a small function that a loop must swallow whole in order to be vectorised, whatever the loop's target
// is.
#define TRACEFLOW_ALWAYS_INLINE inline __attribute__((always_inline))

namespace traceflow {

// Where a tensor lives and where the op that reads it runs.
enum class Device { cpu, cuda };

}  // namespace traceflow
