#include <cuda_runtime.h>

#include <limits>

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
  // Also reported when a library's kernel needs memory at its first launch.
  if (result == cudaErrorMemoryAllocation) {
    cudaGetLastError();  // clears the error
    size_t free = 0, total = 0;
    cudaMemGetInfo(&free, &total);
    throw memory::OutOfMemory(0, free);
  }
  require(result == cudaSuccess, what, result == cudaSuccess ? "" : cudaGetErrorString(result));
}

namespace {

__global__ void nothing() {}

// Checks that this program contains code for the device.
cudaError_t find_code() {
  cudaFuncAttributes attributes{};
  return cudaFuncGetAttributes(&attributes, reinterpret_cast<const void*>(nothing));
}

// Freed memory stays in the pool, so the driver is asked only while the program's use grows. Null if the
// device has no pools.
cudaMemPool_t pool() {
  static const cudaMemPool_t the_pool = [] {
    int has_pools = 0;
    check(cudaDeviceGetAttribute(&has_pools, cudaDevAttrMemoryPoolsSupported, 0), "the CUDA device's pools");
    cudaMemPool_t made = nullptr;
    if (has_pools == 0) return made;
    cudaMemPoolProps properties{};
    properties.allocType = cudaMemAllocationTypePinned;
    properties.location = {cudaMemLocationTypeDevice, 0};
    check(cudaMemPoolCreate(&made, &properties), "a pool of memory on the CUDA device");
    uint64_t kept = std::numeric_limits<uint64_t>::max();
    check(cudaMemPoolSetAttribute(made, cudaMemPoolAttrReleaseThreshold, &kept),
          "a pool of memory on the CUDA device");
    return made;
  }();
  return the_pool;
}

cudaError_t take(void** memory, size_t bytes) {
  return pool() == nullptr ? cudaMalloc(memory, bytes)
                           : cudaMallocFromPoolAsync(memory, bytes, pool(), stream());
}

}  // namespace

bool answers(std::string& why_not) {
  int count = 0;
  cudaError_t result = cudaGetDeviceCount(&count);
  if (result == cudaSuccess && count > 0) result = find_code();
  if (result == cudaSuccess && count > 0) return true;
  why_not = result == cudaSuccess ? "no device is there" : cudaGetErrorString(result);
  cudaGetLastError();  // clears the error
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
  cudaError_t result = take(&memory, bytes);
  if (result == cudaErrorMemoryAllocation && pool() != nullptr) {
    // Before the last attempt, returns the pool's unused pieces to the driver.
    cudaGetLastError();
    trim_pool();
    result = take(&memory, bytes);
  }
  if (result == cudaErrorMemoryAllocation) {
    cudaGetLastError();
    throw memory::OutOfMemory(bytes, facts().free_bytes);
  }
  check(result, "memory on the CUDA device");
  return memory;
}

void release(void* memory) noexcept {
  if (pool() == nullptr) {
    cudaFree(memory);
  } else {
    cudaFreeAsync(memory, stream());
  }
}

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

void trim_pool() {
  synchronise();
  if (pool() != nullptr) check(cudaMemPoolTrimTo(pool(), 0), "a pool of memory on the CUDA device");
}

void synchronise() { check(cudaStreamSynchronize(stream()), "work on the CUDA device"); }

}  // namespace traceflow::cuda
