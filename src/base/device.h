#pragma once

#include <array>
#include <cstdint>
#include <string_view>

// Marks a function that runs on the host and, when compiled by nvcc, on the device too.
#if defined(__CUDACC__)
#define TRACEFLOW_HD __host__ __device__
#else
#define TRACEFLOW_HD
#endif

// Marks the declaration of a function that is defined only in programs linked with the CUDA code. In others
// its address is null. A caller that holds tensors on the CUDA device may call it unchecked: without the CUDA
// code no tensor can be there, and the build of a program with the CUDA code fails if a function is missing
// (cmake/RequireCudaCode.cmake).
#define TRACEFLOW_WITH_CUDA [[gnu::weak]]

// For a small function that must be inlined for a loop to be vectorised, whatever the loop's target is.
#define TRACEFLOW_ALWAYS_INLINE inline __attribute__((always_inline))

namespace traceflow {

// Prefetches bytes into the host's cache; does nothing on a device.
TRACEFLOW_HD inline void prefetch([[maybe_unused]] const void* begin, [[maybe_unused]] int64_t bytes) {
#if !defined(__CUDA_ARCH__)
  constexpr int64_t line = 64;
  for (int64_t at = 0; at < bytes; at += line) __builtin_prefetch(static_cast<const char*>(begin) + at);
#endif
}

// Where a tensor is stored, and where the ops that read it run.
enum class Device { cpu, cuda };
constexpr std::array<std::string_view, 2> enum_names(Device) { return {"cpu", "cuda"}; }
constexpr std::string_view name_of(Device device) { return enum_names(device)[static_cast<size_t>(device)]; }

}  // namespace traceflow
