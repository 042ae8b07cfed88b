#include "ops/field/cuda/column_sums.h"

#include "base/kernel.h"
#include "ops/field/cuda/kernels.h"

namespace traceflow::field::cuda {

namespace {

using device::Numbers;

constexpr int sum_threads = 256;

// One block per slot. Its threads cover the columns and, if there are enough threads, several rows.
template <class T>
__global__ void column_sums_kernel(const T* values, int64_t rows, int columns, float* sums,
                                   int64_t sums_stride) {
  constexpr int numbers = Numbers<T>::count;
  __shared__ float shared[sum_threads][numbers];
  const int groups = columns / numbers;
  const int side_by_side = sum_threads / groups;
  const int thread = static_cast<int>(threadIdx.x);
  const int group = thread % groups;
  const int64_t end = (int64_t{blockIdx.x} + 1) * rows / gridDim.x;

  float sum[numbers] = {};
  if (thread < side_by_side * groups) {
    for (int64_t row = blockIdx.x * rows / gridDim.x + thread / groups; row < end; row += side_by_side) {
      const Numbers<T> read = Numbers<T>::at(values + row * columns + group * numbers);
      for (int k = 0; k < numbers; ++k) sum[k] += to_float(read.value[k]);
    }
  }
  for (int k = 0; k < numbers; ++k) shared[thread][k] = sum[k];
  __syncthreads();
  if (thread >= columns) return;
  for (int column = thread; column < columns; column += sum_threads) {
    float total = 0;
    for (int r = 0; r < side_by_side; ++r) total += shared[r * groups + column / numbers][column % numbers];
    sums[blockIdx.x * sums_stride + column] += total;
  }
}

template <class T>
void run(const T* values, int64_t rows, int columns, int slots, float* sums, int64_t sums_stride) {
  traceflow::cuda::launch("field: column sums", {slots, sum_threads}, column_sums_kernel<T>, values, rows,
                          columns, sums, sums_stride);
}

}  // namespace

void add_column_sums(const float* values, int64_t rows, int columns, int slots, float* sums,
                     int64_t sums_stride) {
  run(values, rows, columns, slots, sums, sums_stride);
}
void add_column_sums(const Bf16* values, int64_t rows, int columns, int slots, float* sums,
                     int64_t sums_stride) {
  run(values, rows, columns, slots, sums, sums_stride);
}

}  // namespace traceflow::field::cuda
