#include "base/kernel.h"
#include "ops/optimize/adam_kernels.h"

// Adam on the device. It is bound by memory bandwidth, so a thread processes groups of neighbouring entries,
// each read and written at once. Tensors begin at aligned addresses.
namespace traceflow::optimize::cuda {

namespace {

constexpr int adam_threads = 256;
constexpr int group_entries = 4;
constexpr int groups_each = 4;  // so that a thread looks up its tensor for more than a few entries
constexpr int block_entries = adam_threads * group_entries * groups_each;

struct alignas(16) Group {
  float value[group_entries];
};

// What all entries of a tensor share.
struct Setting {
  AdamOptions options;
  float inverse_correction1, inverse_correction2;
  LeftAlone* left_alone;

  __device__ void update(int64_t i, float rate, float g, float& m, float& v, float& p) const {
    const float squared = g * g;
    if (!std::isfinite(squared)) {
      atomicAdd(&left_alone->count, 1);
      atomicMax(&left_alone->inverted_first, LeftAlone::largest_index - static_cast<int32_t>(i));
      return;
    }
    m = options.beta1 * m + (1 - options.beta1) * g;
    v = options.beta2 * v + (1 - options.beta2) * squared;
    p -= rate * (m * inverse_correction1) / (std::sqrt(v * inverse_correction2) + options.epsilon);
  }
};

__global__ void __launch_bounds__(adam_threads) step(const __grid_constant__ AdamTable table) {
  __shared__ float rates[most_rates];
  const auto thread = static_cast<int>(threadIdx.x), block = static_cast<int>(blockIdx.x);
  const int k = traceflow::cuda::part_of_block(table.tensor.data(), table.tensors, block);
  // A copy: through the table the compiler could not rule out aliasing with what it writes, and would store
  // number by number.
  const AdamTensor t = table.tensor[static_cast<size_t>(k)];
  const Setting setting{table.options, t.inverse_correction1, t.inverse_correction2, table.left_alone + k};
  if (thread < t.columns) rates[thread] = table.rate[static_cast<size_t>(t.first_rate + thread)];
  __syncthreads();

  const int64_t block_begin = int64_t{block - t.first_block} * block_entries;
  const int64_t block_end = std::min<int64_t>(t.count, block_begin + block_entries);
  for (int64_t begin = block_begin + thread * group_entries; begin < block_end;
       begin += adam_threads * group_entries) {
    int32_t column = static_cast<int32_t>(begin) % t.columns;
    const auto next_rate = [&] {
      const float rate = rates[column];
      column = column + 1 == t.columns ? 0 : column + 1;
      return rate;
    };
    if (begin + group_entries > t.count) {
      for (int64_t i = begin; i < t.count; ++i)
        setting.update(i, next_rate(), t.gradient[i], t.first[i], t.second[i], t.parameter[i]);
      continue;
    }
    const Group g = *reinterpret_cast<const Group*>(t.gradient + begin);
    Group m = *reinterpret_cast<Group*>(t.first + begin);
    Group v = *reinterpret_cast<Group*>(t.second + begin);
    Group p = *reinterpret_cast<Group*>(t.parameter + begin);
    for (int entry = 0; entry < group_entries; ++entry)
      setting.update(begin + entry, next_rate(), g.value[entry], m.value[entry], v.value[entry],
                     p.value[entry]);
    *reinterpret_cast<Group*>(t.first + begin) = m;
    *reinterpret_cast<Group*>(t.second + begin) = v;
    *reinterpret_cast<Group*>(t.parameter + begin) = p;
  }
}

}  // namespace

void adam_step(AdamTable& table) {
  const int64_t blocks = traceflow::cuda::assign_blocks(
      std::span(table.tensor).first(static_cast<size_t>(table.tensors)),
      [](const AdamTensor& tensor) { return traceflow::cuda::blocks_for(tensor.count, block_entries); });
  traceflow::cuda::launch("optimize: adam", {blocks, adam_threads}, step, table);
}

}  // namespace traceflow::optimize::cuda
