#include "base/kernel.h"
#include "ops/optimize/adam_kernels.h"

// Adam on the device: bound by memory, so a thread takes whole groups of neighbouring entries, which travel
// in one piece. Tensors begin at aligned addresses.
namespace traceflow::optimize::cuda {

namespace {

constexpr int threads = 256;
constexpr int group_entries = 4;
constexpr int groups_each = 4;  // so that the rates are not brought in for a handful of entries

struct alignas(16) Group {
  float value[group_entries];
};

__device__ void update(const AdamTensor& t, int64_t i, float rate, float g, float& m, float& v, float& p) {
  const float squared = g * g;
  if (!std::isfinite(squared)) {
    atomicAdd(&t.left_alone->count, 1);
    atomicMax(&t.left_alone->inverted_first, LeftAlone::largest_index - static_cast<int32_t>(i));
    return;
  }
  m = t.beta1 * m + (1 - t.beta1) * g;
  v = t.beta2 * v + (1 - t.beta2) * squared;
  p -= rate * (m * t.inverse_correction1) / (std::sqrt(v * t.inverse_correction2) + t.epsilon);
}

__global__ void __launch_bounds__(threads) step(AdamTensor t) {
  __shared__ float rates[most_rates];
  const auto thread = static_cast<int>(threadIdx.x);
  if (thread < t.columns) rates[thread] = t.rates[static_cast<size_t>(thread)];
  __syncthreads();

  const int64_t stride = int64_t{gridDim.x} * threads * group_entries;
  for (int64_t begin = (int64_t{blockIdx.x} * threads + thread) * group_entries; begin < t.count;
       begin += stride) {
    int32_t column = static_cast<int32_t>(begin) % t.columns;
    const auto next_rate = [&] {
      const float rate = rates[column];
      column = column + 1 == t.columns ? 0 : column + 1;
      return rate;
    };
    if (begin + group_entries > t.count) {
      for (int64_t i = begin; i < t.count; ++i)
        update(t, i, next_rate(), t.gradient[i], t.first[i], t.second[i], t.parameter[i]);
      continue;
    }
    const Group g = *reinterpret_cast<const Group*>(t.gradient + begin);
    Group m = *reinterpret_cast<Group*>(t.first + begin);
    Group v = *reinterpret_cast<Group*>(t.second + begin);
    Group p = *reinterpret_cast<Group*>(t.parameter + begin);
    for (int k = 0; k < group_entries; ++k)
      update(t, begin + k, next_rate(), g.value[k], m.value[k], v.value[k], p.value[k]);
    *reinterpret_cast<Group*>(t.first + begin) = m;
    *reinterpret_cast<Group*>(t.second + begin) = v;
    *reinterpret_cast<Group*>(t.parameter + begin) = p;
  }
}

}  // namespace

void adam_step(const AdamTensor& tensor) {
  const int64_t blocks = traceflow::cuda::blocks_for(tensor.count, threads * group_entries * groups_each);
  traceflow::cuda::launch("optimize: adam", {blocks, threads}, step, tensor);
}

}  // namespace traceflow::optimize::cuda
