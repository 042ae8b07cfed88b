#include <cuda_runtime.h>

#include "base/device_memory.h"
#include "base/kernel.h"

namespace traceflow::cuda {

cudaStream_t stream() {
  static const cudaStream_t the_stream = [] {
    cudaStream_t created = nullptr;
    check(cudaStreamCreateWithFlags(&created, cudaStreamNonBlocking), "the CUDA stream");
    return created;
  }();
  return the_stream;
}

void check(cudaError_t result, const char* what) {
  require(result == cudaSuccess, what, result == cudaSuccess ? "" : cudaGetErrorString(result));
}

bool answers(std::string& why_not) {
  int count = 0;
  const cudaError_t result = cudaGetDeviceCount(&count);
  if (result == cudaSuccess && count > 0) return true;
  why_not = result == cudaSuccess ? "no device is there" : cudaGetErrorString(result);
  cudaGetLastError();  // forgets it
  return false;
}

DeviceFacts facts() {
  cudaDeviceProp properties{};
  check(cudaGetDeviceProperties(&properties, 0), "the CUDA device's properties");
  DeviceFacts facts{properties.name, properties.major, properties.minor, 0, 0};
  check(cudaMemGetInfo(&facts.free_bytes, &facts.total_bytes), "the CUDA device's memory");
  return facts;
}

void* allocate(size_t bytes) {
  if (bytes == 0) return nullptr;
  void* memory = nullptr;
  const cudaError_t result = cudaMalloc(&memory, bytes);
  if (result == cudaErrorMemoryAllocation) {
    cudaGetLastError();
    throw memory::OutOfMemory(bytes, facts().free_bytes);
  }
  check(result, "memory on the CUDA device");
  return memory;
}

void release(void* memory) noexcept { cudaFree(memory); }

void copy(Device to_device, void* to, Device from_device, const void* from, size_t bytes) {
  const cudaMemcpyKind kind = to_device == Device::cpu     ? cudaMemcpyDeviceToHost
                              : from_device == Device::cpu ? cudaMemcpyHostToDevice
                                                           : cudaMemcpyDeviceToDevice;
  check(cudaMemcpyAsync(to, from, bytes, kind, stream()), "a copy on the CUDA device");
  if (to_device == Device::cpu || from_device == Device::cpu) synchronise();
}

void zero(void* memory, size_t bytes) {
  check(cudaMemsetAsync(memory, 0, bytes, stream()), "zeros on the CUDA device");
}

void synchronise() { check(cudaStreamSynchronize(stream()), "work on the CUDA device"); }

}  // namespace traceflow::cuda
