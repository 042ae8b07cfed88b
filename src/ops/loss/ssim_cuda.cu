#include "ops/loss/ssim_cuda.h"

#include "primitives/sum_kernels.h"

// SSIM by tiles of one channel. A block loads its tile with the border that the window covers (zeros outside
// the image), sums along the rows into shared memory and then down the columns: the window is separable. The
// forward pass does so for the four moments and writes the derivatives by them to planes. In the backward
// pass, the adjoint of a symmetric window with zero padding is the window itself, so the three planes pass
// through the same two sums.
namespace traceflow::loss::cuda {

namespace {

using traceflow::cuda::add_up;
using traceflow::cuda::block_sum;
using traceflow::cuda::launch;
using traceflow::cuda::memory_for_partial_sums;
using traceflow::cuda::sum_threads;

constexpr int channels = 3;
constexpr int taps = 2 * ssim_radius + 1;
constexpr int tile_columns = 32, tile_rows = 16;
constexpr int rows_each = 2;  // rows that a thread sums
constexpr int loaded_columns = tile_columns + 2 * ssim_radius, loaded_rows = tile_rows + 2 * ssim_radius;
constexpr int ssim_threads = static_cast<int>(sum_threads);
static_assert(tile_columns * tile_rows == ssim_threads * rows_each);

struct Size {
  int height, width;
  __host__ __device__ int tiles_across() const { return (width + tile_columns - 1) / tile_columns; }
  __host__ __device__ int tiles_down() const { return (height + tile_rows - 1) / tile_rows; }
  __host__ __device__ int64_t pixels() const { return int64_t{height} * width; }
  int64_t blocks() const { return int64_t{tiles_across()} * tiles_down() * channels; }
};

struct Pictures {
  const float *image, *target;  // H×W×3
  Size size;
};

// One for each channel: 3×H×W.
struct DerivativePlanes {
  float *by_mean_x, *by_squares, *by_product;
};

// A block's channel and first pixel. The channels of a tile follow each other, so that they find its pixels
// in the cache.
struct Tile {
  int channel, row, column;
};
__device__ Tile tile_of_block(const Size& size) {
  const int block = static_cast<int>(blockIdx.x);
  const int tile = block / channels;
  return {block % channels, tile / size.tiles_across() * tile_rows,
          tile % size.tiles_across() * tile_columns};
}

// Stores value(pixel) for every pixel of a tile and its border.
template <class F>
__device__ void load(const Tile& tile, const Size& size, F value,
                     float (&into)[loaded_rows][loaded_columns]) {
  for (int i = static_cast<int>(threadIdx.x); i < loaded_rows * loaded_columns; i += ssim_threads) {
    const int r = i / loaded_columns, c = i % loaded_columns;
    const int row = tile.row + r - ssim_radius, column = tile.column + c - ssim_radius;
    const bool inside = row >= 0 && row < size.height && column >= 0 && column < size.width;
    into[r][c] = inside ? value(int64_t{row} * size.width + column) : 0.0F;
  }
}

__device__ float tap(const HalfWindow& window, int k) {
  return window[static_cast<size_t>(k < ssim_radius ? ssim_radius - k : k - ssim_radius)];
}

__device__ float finite_or_zero(float v) {
  return std::abs(v) <= std::numeric_limits<float>::max() ? v : 0.0F;
}

// The middle columns of a tile's rows, summed along the rows: one map per moment or derivative.
template <int maps>
using Along = float[maps][loaded_rows][tile_columns];

// Sums the maps down a column for the thread's rows_each rows, which begin at `first`.
template <int maps>
__device__ void sum_down(const Along<maps>& along, const HalfWindow& window, int first, int column,
                         float (&sum)[rows_each][maps]) {
  for (int o = 0; o < rows_each; ++o) {
    for (int m = 0; m < maps; ++m) sum[o][m] = 0;
  }
  for (int k = 0; k < taps + rows_each - 1; ++k) {
    for (int m = 0; m < maps; ++m) {
      const float value = along[m][first + k][column];
      for (int o = 0; o < rows_each; ++o) {
        if (k >= o && k < taps + o) sum[o][m] += tap(window, k - o) * value;
      }
    }
  }
}

// Σ SSIM over the pixels that count, and their number, per block; and the derivatives, unless their planes
// are null. Values that are not finite have no derivative.
__global__ void __launch_bounds__(sum_threads)
    compare_tiles(Pictures p, HalfWindow window, const uint8_t* mask, DerivativePlanes planes,
                  CountedSum* partial) {
  __shared__ float x[loaded_rows][loaded_columns], y[loaded_rows][loaded_columns];
  __shared__ Along<4> along;
  const Tile tile = tile_of_block(p.size);
  load(
      tile, p.size, [&](int64_t pixel) { return p.image[pixel * channels + tile.channel]; }, x);
  load(
      tile, p.size, [&](int64_t pixel) { return p.target[pixel * channels + tile.channel]; }, y);
  __syncthreads();

  for (int i = static_cast<int>(threadIdx.x); i < loaded_rows * tile_columns; i += ssim_threads) {
    const int r = i / tile_columns, c = i % tile_columns;
    SsimMoments<float> m{0, 0, 0, 0};
    for (int k = 0; k < taps; ++k) {
      const float w = tap(window, k), a = x[r][c + k], b = y[r][c + k];
      m.mean_x += w * a;
      m.mean_y += w * b;
      m.squares += w * (a * a + b * b);
      m.product += w * (a * b);
    }
    along[0][r][c] = m.mean_x;
    along[1][r][c] = m.mean_y;
    along[2][r][c] = m.squares;
    along[3][r][c] = m.product;
  }
  __syncthreads();

  const int c = static_cast<int>(threadIdx.x) % tile_columns;
  const int first = static_cast<int>(threadIdx.x) / tile_columns * rows_each;
  float moments[rows_each][4];
  sum_down<4>(along, window, first, c, moments);
  CountedSum sum;
  for (int o = 0; o < rows_each; ++o) {
    const int row = tile.row + first + o, column = tile.column + c;
    if (row >= p.size.height || column >= p.size.width) continue;
    const float(&m)[4] = moments[o];
    const auto d = ssim_with_derivative<float>({m[0], m[1], m[2], m[3]});
    const int64_t pixel = int64_t{row} * p.size.width + column;
    if (mask == nullptr || mask[pixel] != 0) sum += {static_cast<double>(d.value), 1};
    if (planes.by_mean_x == nullptr) continue;
    const int64_t place = tile.channel * p.size.pixels() + pixel;
    planes.by_mean_x[place] = finite_or_zero(d.by_mean_x);
    planes.by_squares[place] = finite_or_zero(d.by_squares);
    planes.by_product[place] = finite_or_zero(d.by_product);
  }
  sum = block_sum(sum);
  if (threadIdx.x == 0) partial[blockIdx.x] = sum;
}

__global__ void __launch_bounds__(sum_threads)
    add_gradient(Pictures p, HalfWindow window, DerivativePlanes planes, float scale, float* gradient) {
  __shared__ float derivative[3][loaded_rows][loaded_columns];
  __shared__ Along<3> along;
  const Tile tile = tile_of_block(p.size);
  const int64_t plane = tile.channel * p.size.pixels();
  load(
      tile, p.size, [&](int64_t pixel) { return planes.by_mean_x[plane + pixel]; }, derivative[0]);
  load(
      tile, p.size, [&](int64_t pixel) { return planes.by_squares[plane + pixel]; }, derivative[1]);
  load(
      tile, p.size, [&](int64_t pixel) { return planes.by_product[plane + pixel]; }, derivative[2]);
  __syncthreads();

  for (int i = static_cast<int>(threadIdx.x); i < loaded_rows * tile_columns; i += ssim_threads) {
    const int r = i / tile_columns, c = i % tile_columns;
    for (int m = 0; m < 3; ++m) {
      float sum = 0;
      for (int k = 0; k < taps; ++k) sum += tap(window, k) * derivative[m][r][c + k];
      along[m][r][c] = sum;
    }
  }
  __syncthreads();

  const int c = static_cast<int>(threadIdx.x) % tile_columns;
  const int first = static_cast<int>(threadIdx.x) / tile_columns * rows_each;
  float sums[rows_each][3];
  sum_down<3>(along, window, first, c, sums);
  for (int o = 0; o < rows_each; ++o) {
    const int row = tile.row + first + o, column = tile.column + c;
    if (row >= p.size.height || column >= p.size.width) continue;
    const int64_t i = (int64_t{row} * p.size.width + column) * channels + tile.channel;
    const float by_value = sums[o][0] + 2 * p.image[i] * sums[o][1] + p.target[i] * sums[o][2];
    gradient[i] += finite_or_zero(scale * by_value);
  }
}

Pictures pictures_of(const Tensor<float>& image, const Tensor<float>& target) {
  return {image.data(), target.data(), {static_cast<int>(image.dim(0)), static_cast<int>(image.dim(1))}};
}

// The term of the loss is 1 − mean.
struct OneLessMean {
  double count;
  Mean* mean;
  TRACEFLOW_HD void operator()(const CountedSum& total) const {
    *mean = {count > 0 ? 1 - total.sum / count : 0, count};
  }
};

template <class Finish>
void compare(const Pictures& p, const HalfWindow& window, const uint8_t* mask, const DerivativePlanes& planes,
             const Finish& finish) {
  const int64_t blocks = p.size.blocks();
  CountedSum* const partial = memory_for_partial_sums<CountedSum>(blocks);
  launch("loss: ssim", {blocks, ssim_threads}, compare_tiles, p, window, mask, planes, partial);
  launch("loss: ssim sum", {1, ssim_threads}, add_up<CountedSum, Finish>, blocks, partial, finish);
}

}  // namespace

void ssim_loss(const Tensor<float>& image, const Tensor<float>& target, const HalfWindow& window,
               double weight, Tensor<float>& grad_image, Mean* mean) {
  const Pictures p = pictures_of(image, target);
  const auto count = static_cast<double>(image.size());
  static thread_local Tensor<float> kept;
  kept.place(Device::cuda).resize({3, image.size()});
  const DerivativePlanes planes{kept.row(0), kept.row(1), kept.row(2)};
  compare(p, window, nullptr, planes, OneLessMean{count, mean});
  launch("loss: ssim backward", {p.size.blocks(), ssim_threads}, add_gradient, p, window, planes,
         static_cast<float>(-weight / count), grad_image.data());
}

void ssim(const Tensor<float>& image, const Tensor<float>& target, const HalfWindow& window,
          const uint8_t* mask, Mean* mean) {
  compare(pictures_of(image, target), window, mask, {nullptr, nullptr, nullptr}, MeanOverCounted{mean});
}

}  // namespace traceflow::loss::cuda
