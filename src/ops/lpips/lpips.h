#pragma once

#include <filesystem>
#include <vector>

#include "base/tensor.h"
#include "ops/loss/mean.h"

// The perceptual distance LPIPS with the VGG-16 network: a figure of merit (method §8) and a term of the
// training loss (method §7.4).
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

// The same parameters laid out for the fast path. All tensors are on one device.
struct Network {
  struct Convolution {
    Tensor<float> matrix;  // (3·3·in)×out, rows in the order of a pixel's 3×3 neighbourhood
    Tensor<float> bias;    // out
  };
  std::vector<Convolution> convolutions;
  std::vector<Tensor<float>> linear;

  Device device() const;
  // The same network on a device.
  Network on(Device device) const;
};
Network network_of(const Weights& weights);

// What the network is fed: [−1, 1] as LPIPS is defined, or [0, 1] as published tables of radiance fields used
// it.
enum class Input { defined, published };

// Distance of two images, H×W×3 in [0, 1], both sides at least min_side; not a number where a pixel is not
// finite. Runs where the images are, which the network must be too. The same bytes every time and at any
// thread count. The host waits for it.
double distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input);

// Leaves the same in a slot, for which nobody waits, and ADDS weight · ddistance/dimage to grad_image
// (H×W×3); target and network are constants. Where the largest of a halving's four pixels is not unique, the
// first has the gradient. A distance or a gradient that is not finite leaves grad_image as it was: the
// network's sight is too wide to say which pixels it spoilt.
void distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
              double weight, Tensor<float>& grad_image, const loss::MeanSlot& value);

// Memory that the gradient of VGG-16's distance takes at most, in bytes: for each pixel of an image, and
// whatever its size. The latter is the network and a block of gathered pixels.
inline constexpr int64_t gradient_bytes_per_pixel = 1750;
inline constexpr int64_t network_bytes = int64_t{128} << 20;

// The plain truth in double precision.
double distance_reference(const BasicWeights<double>& weights, const Tensor<double>& image,
                          const Tensor<double>& target, Input input);
double distance_reference(const BasicWeights<double>& weights, const Tensor<double>& image,
                          const Tensor<double>& target, Input input, double weight,
                          Tensor<double>& grad_image);

}  // namespace traceflow::lpips
