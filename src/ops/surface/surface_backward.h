#pragma once

#include "base/tensor.h"
#include "ops/surface/surface_kernels.h"
#include "primitives/sums.h"

namespace traceflow::surface {

// Runs step(i) for every i in [0, n) on the CUDA device. Sums the camera's gradient only if it is wanted. The
// host waits for that sum, because poses are stored on the host.
template <class T, class Step>
void backward_on_device(const char* description, int64_t n, const Step& step,
                        CameraGradient<T>* grad_camera) {
  if (grad_camera == nullptr) {
    parallel_for(Device::cuda, description, n, step);
    return;
  }
  static thread_local Tensor<CameraSum<T>> kept;
  kept.place(Device::cuda).resize({1});
  ordered_sum<CameraSum<T>>(Device::cuda, description, n, step, StoreSum<CameraSum<T>>{kept.data()}, 0);
  std::vector<CameraSum<T>> total(1);
  memory::copy(Device::cpu, total.data(), Device::cuda, kept.data(), sizeof(total[0]));
  add_in_order(total, *grad_camera);
}

}  // namespace traceflow::surface
