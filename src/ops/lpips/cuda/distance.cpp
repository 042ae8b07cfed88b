#include "ops/lpips/cuda/distance.h"

#include <algorithm>
#include <array>
#include <utility>

#include "ops/lpips/cuda/compare.h"
#include "ops/lpips/cuda/kernels.h"
#include "primitives/gemm.h"
#include "primitives/sums.h"

namespace traceflow::lpips::device {

namespace {

using traceflow::cuda::GemmAddresses;
using traceflow::cuda::GemmDescription;
using traceflow::cuda::multiply;

constexpr size_t layers = 13;
constexpr int64_t sum_grain = 4096;

int64_t rounded_up(int64_t n, int64_t to) { return (n + to - 1) / to * to; }

template <class T>
T* sized(Tensor<T>& tensor, const Shape& shape) {
  tensor.place(Device::cuda).resize(shape);
  return tensor.data();
}

// As elements of the steps: four channels each.
const Four* fours(const float* values) { return reinterpret_cast<const Four*>(values); }
Four* fours(float* values) { return reinterpret_cast<Four*>(values); }
FourBytes* fours(uint8_t* values) { return reinterpret_cast<FourBytes*>(values); }

// Kept between calls, so that training stops allocating. The backward pass needs only the first image's part
// of the forward pass.
struct Memory {
  Tensor<float> activations[2];  // of two layers, alternating; in the backward pass of gradients
  Tensor<float> patches;
  Tensor<float> weights;                            // of one convolution, padded
  std::array<Tensor<uint8_t>, layers> gates;        // of each convolution except the last of a stage
  std::array<Tensor<uint8_t>, stages> places;       // of the pooling before each stage
  std::array<Tensor<float>, stages> grad_features;  // dL/d(last features) from the stage's own share, with
                                                    // closed gates applied
  Tensor<double> distances;                         // of the pixels of a stage
  Tensor<double> check;                             // one number: 0 if the gradient is finite
};

// A convolution in the format of the products.
struct Layer {
  const float* matrix;  // (9·inputs)×outputs
  const float* bias;
  int64_t inputs, outputs;  // padded
};

Layer layer_of(const Network::Convolution& convolution, Memory& memory) {
  const int64_t inputs = convolution.matrix.dim(0) / 9, outputs = convolution.matrix.dim(1);
  if (inputs % 4 == 0 && outputs % 4 == 0) {
    return {convolution.matrix.data(), convolution.bias.data(), inputs, outputs};
  }
  const int64_t padded_inputs = rounded_up(inputs, 4), padded_outputs = rounded_up(outputs, 4);
  const int64_t rows = 9 * padded_inputs;
  float* const padded = sized(memory.weights, {rows + 1, padded_outputs});
  parallel_for(Device::cuda, "lpips: pad weights", memory.weights.size(),
               PadWeights{convolution.matrix.data(), convolution.bias.data(), static_cast<uint32_t>(inputs),
                          static_cast<uint32_t>(outputs), static_cast<uint32_t>(padded_inputs),
                          static_cast<uint32_t>(padded_outputs), padded});
  return {padded, padded + rows * padded_outputs, padded_inputs, padded_outputs};
}

// Size of the images in a stage.
struct Size {
  int64_t height, width;

  int64_t pixels() const { return height * width; }
  Size halved() const { return {height / 2, width / 2}; }
  Extent extent(int64_t channels) const {
    return {static_cast<uint32_t>(height), static_cast<uint32_t>(width), static_cast<uint32_t>(channels / 4)};
  }
};

// Pixels are processed in blocks of `rows`; the last block may be shorter.
struct Blocks {
  int64_t rows, count;
};
Blocks blocks_of(int64_t pixels, int64_t inputs) {
  constexpr int64_t quantum = 128;
  const int64_t pixel_bytes = 9 * inputs * static_cast<int64_t>(sizeof(float));
  const int64_t most = std::max(patch_bytes / pixel_bytes / quantum, int64_t{1}) * quantum;
  const int64_t count = (pixels + most - 1) / most;
  return {rounded_up((pixels + count - 1) / count, quantum), count};
}

// 3×3 convolution of both images with zero padding, then max(0, ·). A shorter last block is computed at full
// size, and nobody reads the rows past its end. A product of another size could sum in another order, so that
// equal images would differ.
void convolve(const Layer& layer, const Size& size, const Tensor<float>& x, Tensor<float>& y,
              Memory& memory) {
  const int64_t pixels = 2 * size.pixels();
  const Blocks blocks = blocks_of(pixels, layer.inputs);
  float* const patches = sized(memory.patches, {blocks.rows, 9 * layer.inputs});
  float* const to = sized(y, {blocks.count * blocks.rows, layer.outputs});
  y.resize({pixels, layer.outputs});
  for (int64_t begin = 0; begin < pixels; begin += blocks.rows) {
    const int64_t end = std::min(begin + blocks.rows, pixels);
    parallel_for(Device::cuda, "lpips: gather", (end - begin) * 9 * layer.inputs / 4,
                 GatherPatches{fours(x.data()), size.extent(layer.inputs), static_cast<uint32_t>(begin),
                               fours(patches)});
    GemmDescription gemm{.m = blocks.rows,
                         .k = 9 * layer.inputs,
                         .n = layer.outputs,
                         .stride_a = 9 * layer.inputs,
                         .stride_b = layer.outputs,
                         .stride_c = layer.outputs,
                         .operands = DType::fp32,
                         .result = DType::fp32,
                         .bias = true,
                         .relu = true};
    const GemmAddresses at{
        .a = patches, .b = layer.matrix, .c = to + begin * layer.outputs, .bias = layer.bias};
    if (traceflow::cuda::supported(gemm)) {
      multiply(gemm, at);
      continue;
    }
    gemm.bias = gemm.relu = false;
    multiply(gemm, at);
    parallel_for(Device::cuda, "lpips: bias and ReLU", (end - begin) * layer.outputs / 4,
                 AddBiasAndRelu{fours(to + begin * layer.outputs), fours(layer.bias),
                                static_cast<uint32_t>(layer.outputs / 4)});
  }
}

// Computes dL/dx of one image from dL/dy, to which closed gates have been applied. gates: of the ReLU that
// computed x; null if there is none.
void convolve_backward(const Layer& layer, const Size& size, const Tensor<float>& grad_y,
                       const Tensor<uint8_t>* gates, Tensor<float>& grad_x, Memory& memory) {
  const int64_t pixels = size.pixels(), border = size.width + 1;
  grad_x.place(Device::cuda).reset({pixels, layer.inputs});
  const Blocks blocks = blocks_of(pixels, layer.inputs);
  float* const grad_patches = sized(memory.patches, {blocks.rows, 9 * layer.inputs});
  for (int64_t begin = 0; begin < pixels; begin += blocks.rows) {
    const int64_t end = std::min(begin + blocks.rows, pixels);
    multiply({.m = end - begin,
              .k = layer.outputs,
              .n = 9 * layer.inputs,
              .transposed_b = true,
              .stride_a = layer.outputs,
              .stride_b = layer.outputs,
              .stride_c = 9 * layer.inputs,
              .operands = DType::fp32,
              .result = DType::fp32},
             {.a = grad_y.row(begin), .b = layer.matrix, .c = grad_patches});
    const int64_t first = std::max<int64_t>(begin - border, 0), last = std::min(end + border, pixels);
    parallel_for(Device::cuda, "lpips: scatter", (last - first) * layer.inputs / 4,
                 AddPatches{fours(grad_patches), begin, end, first, size.extent(layer.inputs),
                            gates == nullptr ? nullptr : reinterpret_cast<const FourBytes*>(gates->data()),
                            fours(grad_x.data())});
  }
}

// Halves both images by max pooling. places: receives those of the first image; may be null.
void halve(const Size& size, const Tensor<float>& x, Tensor<float>& halved, Tensor<uint8_t>* places) {
  const int64_t channels = x.dim(1), pixels = size.halved().pixels();
  float* const to = sized(halved, {2 * pixels, channels});
  uint8_t* const kept = places == nullptr ? nullptr : sized(*places, {pixels, channels});
  parallel_for(Device::cuda, "lpips: halve", halved.size() / 4,
               Halve{fours(x.data()), size.extent(channels), fours(to), fours(kept),
                     kept == nullptr ? 0 : pixels * channels / 4});
}

// Adds a stage's share to the distance.
void compare(const Tensor<float>& features, const Tensor<float>& linear, double weight, loss::Mean* value,
             Tensor<float>* grad, Memory& memory) {
  const int64_t pixels = features.dim(0) / 2, stride = features.dim(1);
  const double share = 1 / static_cast<double>(pixels);
  double* const distances = sized(memory.distances, {pixels});
  cuda::compare({.a = features.data(),
                 .b = features.row(pixels),
                 .linear = linear.data(),
                 .pixels = pixels,
                 .channels = static_cast<int>(linear.size()),
                 .stride = static_cast<int>(stride)},
                weight * share, distances, grad == nullptr ? nullptr : sized(*grad, {pixels, stride}));
  ordered_sum<double>(Device::cuda, "lpips: distance", pixels, Load{distances}, AddToDistance{value, share},
                      sum_grain);
}

void forward(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
             double weight, bool keeps_trail, loss::Mean* value, Memory& memory) {
  Size size{image.dim(0), image.dim(1)};
  Tensor<float>*x = &memory.activations[0], *y = &memory.activations[1];
  Four* const scaled = fours(sized(*x, {2 * size.pixels(), 4}));
  ordered_sum<double>(Device::cuda, "lpips: scale", 2 * size.pixels(),
                      ScaleImages{image.data(), target.data(), size.pixels(), input, scaled},
                      BeginDistance{value}, sum_grain);
  size_t next = 0;
  for (size_t stage = 0; stage < stages; ++stage) {
    if (stage > 0) {
      halve(size, *x, *y, keeps_trail ? &memory.places[stage] : nullptr);
      std::swap(x, y);
      size = size.halved();
    }
    for (int left = convolutions_in_stage[stage]; left > 0; --left, ++next) {
      convolve(layer_of(network.convolutions[next], memory), size, *x, *y, memory);
      std::swap(x, y);
      if (!keeps_trail || left == 1) continue;
      uint8_t* const gates = sized(memory.gates[next], {size.pixels(), x->dim(1)});
      parallel_for(Device::cuda, "lpips: gates", memory.gates[next].size() / 4,
                   KeepGates{fours(x->data()), fours(gates)});
    }
    compare(*x, network.linear[stage], weight, value, keeps_trail ? &memory.grad_features[stage] : nullptr,
            memory);
  }
}

// dL/d(the first layer's input).
const Tensor<float>& backward(const Network& network, const Size& full, Memory& memory) {
  std::array<Size, stages> sizes{full};
  for (size_t stage = 1; stage < stages; ++stage) sizes[stage] = sizes[stage - 1].halved();
  const Tensor<float>* grad = nullptr;
  size_t next = network.convolutions.size();
  size_t turn = 0;
  for (size_t stage = stages; stage-- > 0;) {
    Tensor<float>& own = memory.grad_features[stage];
    if (grad != nullptr) {
      parallel_for(Device::cuda, "lpips: halve backward", grad->size() / 4,
                   HalveBackward{fours(grad->data()), fours(memory.places[stage + 1].data()),
                                 sizes[stage].extent(own.dim(1)), own.data()});
    }
    grad = &own;
    for (int left = convolutions_in_stage[stage]; left > 0; --left) {
      --next;
      Tensor<float>& grad_x = memory.activations[turn++ % 2];
      convolve_backward(layer_of(network.convolutions[next], memory), sizes[stage], *grad,
                        left > 1 ? &memory.gates[next - 1] : nullptr, grad_x, memory);
      grad = &grad_x;
    }
  }
  return *grad;
}

Memory& kept_memory() {
  thread_local Memory memory;
  return memory;
}

}  // namespace

void distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
              loss::Mean* value) {
  forward(network, image, target, input, 0, false, value, kept_memory());
}

void distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
              double weight, Tensor<float>& grad_image, loss::Mean* value) {
  Memory& memory = kept_memory();
  forward(network, image, target, input, weight, true, value, memory);
  const Four* const grad = fours(backward(network, {image.dim(0), image.dim(1)}, memory).data());
  const int64_t pixels = image.dim(0) * image.dim(1);
  double* const check = sized(memory.check, {1});
  ordered_sum<double>(Device::cuda, "lpips: check gradient", pixels, CheckGradient{grad},
                      StoreSum<double>{check}, sum_grain);
  parallel_for(Device::cuda, "lpips: add gradient", pixels,
               AddGradient{grad, value, check, input, grad_image.data()});
}

}  // namespace traceflow::lpips::device
