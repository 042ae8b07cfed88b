#pragma once

#include <filesystem>
#include <vector>

#include "base/tensor.h"
#include "ops/loss/mean.h"

// The perceptual distance LPIPS with the VGG-16 network: a metric (method §8) and a term of the training loss
// (method §7.4).
namespace traceflow::lpips {

// The network's parameters. Widths follow from the shapes, so that tests can use small ones. The architecture
// is that of VGG-16: 2, 2, 3, 3, 3 convolutions of 3×3, with pooling before each stage but the first.
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
// Smallest image side for which every stage has at least one pixel.
inline constexpr int min_side = 16;

// Reads a file of scripts/export_lpips.py: torchvision's names "features.N.weight" and "features.N.bias" for
// the convolutions and lpips's "linN.model.1.weight" for the linear layers. Throws InputError for any other
// file.
Weights read_weights(const std::filesystem::path& path);

// The same parameters in the layout of the fast path. All tensors are on one device.
struct Network {
  struct Convolution {
    Tensor<float> matrix;  // (3·3·in)×out, rows in the order of a pixel's 3×3 neighbourhood
    Tensor<float> bias;    // out
  };
  std::vector<Convolution> convolutions;
  std::vector<Tensor<float>> linear;

  Device device() const;
  // A copy on a device.
  Network on(Device device) const;
};
Network network_of(const Weights& weights);

// The range of the network's input: [−1, 1] as LPIPS defines it, or [0, 1] as in published tables of radiance
// fields.
enum class Input { defined, published };

// Distance of two images, H×W×3 in [0, 1], both sides at least min_side; NaN if a pixel is not finite. Runs
// on the device of the images, where the network must be too. The same bytes every time and at any thread
// count. The host waits for it.
double distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input);

// Writes the same to a slot, without a wait, and ADDS weight · ddistance/dimage to grad_image (H×W×3); target
// and network are constants. If the largest of the four pooled pixels is not unique, the first gets the
// gradient. If the distance or a gradient is not finite, grad_image is unchanged: the network's receptive
// field is too wide to tell which pixels are affected.
void distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
              double weight, Tensor<float>& grad_image, const loss::MeanSlot& value);

// Upper bounds on the memory for the gradient with VGG-16, in bytes: per pixel of an image, and independent
// of its size. The latter is the network and a block of gathered pixels.
inline constexpr int64_t gradient_bytes_per_pixel = 1750;
inline constexpr int64_t network_bytes = int64_t{128} << 20;

// The reference in double precision.
double distance_reference(const BasicWeights<double>& weights, const Tensor<double>& image,
                          const Tensor<double>& target, Input input);
double distance_reference(const BasicWeights<double>& weights, const Tensor<double>& image,
                          const Tensor<double>& target, Input input, double weight,
                          Tensor<double>& grad_image);

}  // namespace traceflow::lpips
