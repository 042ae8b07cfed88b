#pragma once

// Marks a function that runs on the host and, when compiled by nvcc, on the device too.
#if defined(__CUDACC__)
#define TRACEFLOW_HD __host__ __device__
#else
#define TRACEFLOW_HD
#endif

namespace traceflow {

// Where a tensor lives and where the op that reads it runs.
enum class Device { cpu, cuda };

}  // namespace traceflow
