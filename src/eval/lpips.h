#pragma once

#include <filesystem>
#include <vector>

#include "base/tensor.h"

// The perceptual distance LPIPS with the VGG-16 network (method §8).
namespace traceflow::lpips {

// The network's parameters. Widths come from the shapes, so that tests can use small ones; the arrangement
// (2, 2, 3, 3, 3 convolutions of 3×3, each stage but the first after a halving) is VGG-16's.
template <class T>
struct BasicWeights {
  struct Convolution {
    Tensor<T> weight;  // out×in×3×3
    Tensor<T> bias;    // out
  };
  std::vector<Convolution> convolutions;  // 13
  std::vector<Tensor<T>> linear;          // 5, one weight per channel of a stage
};
using Weights = BasicWeights<float>;

inline constexpr int stages = 5;
inline constexpr int convolutions_in_stage[stages] = {2, 2, 3, 3, 3};
// Narrowest image side that every stage sees at least one pixel of.
inline constexpr int min_side = 16;

// Reads what scripts/export_lpips.py writes: torchvision's names "features.N.weight" and "features.N.bias"
// for the convolutions and lpips's "linN.model.1.weight" for the linear layers. Throws InputError for another
// file.
Weights read_weights(const std::filesystem::path& path);

// What the network is fed: [−1, 1] as LPIPS is defined, or [0, 1] as published tables of radiance fields used
// it.
enum class Input { defined, published };

// Distance of two images, H×W×3 in [0, 1], both sides at least min_side. The same bytes at any thread count.
double distance(const Weights& weights, const Tensor<float>& image, const Tensor<float>& target, Input input);

// The plain truth in double precision.
double distance_reference(const BasicWeights<double>& weights, const Tensor<double>& image,
                          const Tensor<double>& target, Input input);

}  // namespace traceflow::lpips
