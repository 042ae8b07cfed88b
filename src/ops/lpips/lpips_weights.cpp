#include <algorithm>
#include <cmath>
#include <string>

#include "files/safetensors.h"
#include "ops/lpips/lpips.h"

namespace traceflow::lpips {

namespace {

constexpr const char* remedy = "write the file with scripts/export_lpips.py";
// Indices of the convolutions in torchvision's vgg16().features; those between are ReLU and pooling.
constexpr int places[] = {0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28};

Tensor<float> read_finite(const Safetensors& file, const std::string& where, const std::string& name) {
  Tensor<float> tensor = file.tensor<float>(name);
  if (!std::all_of(tensor.data(), tensor.data() + tensor.size(), [](float v) { return std::isfinite(v); })) {
    throw InputError(where, name, "a number that is not finite", "finite numbers", remedy);
  }
  return tensor;
}

Weights::Convolution read_convolution(const Safetensors& file, const std::string& where, int place,
                                      int64_t inputs) {
  const std::string name = "features." + std::to_string(place);
  Weights::Convolution c{read_finite(file, where, name + ".weight"),
                         read_finite(file, where, name + ".bias")};
  const Shape& shape = c.weight.shape();
  if (shape.rank() != 4 || shape[0] < 1 || shape[1] != inputs || shape[2] != 3 || shape[3] != 3) {
    throw InputError(where, name + ".weight", shape.to_string(), "Nx" + std::to_string(inputs) + "x3x3",
                     remedy);
  }
  if (c.bias.shape() != Shape{shape[0]}) {
    throw InputError(where, name + ".bias", c.bias.shape().to_string(), std::to_string(shape[0]), remedy);
  }
  return c;
}

Tensor<float> read_linear(const Safetensors& file, const std::string& where, int stage, int64_t channels) {
  const std::string name = "lin" + std::to_string(stage) + ".model.1.weight";
  const Tensor<float> stored = read_finite(file, where, name);
  if (stored.size() != channels) {
    throw InputError(where, name, stored.shape().to_string(), "1x" + std::to_string(channels) + "x1x1",
                     remedy);
  }
  Tensor<float> linear(Shape{channels});
  std::copy(stored.data(), stored.data() + channels, linear.data());
  return linear;
}

}  // namespace

Weights read_weights(const std::filesystem::path& path) {
  const Safetensors file = Safetensors::read(path);
  Weights weights;
  int64_t channels = 3;
  size_t next = 0;
  for (int stage = 0; stage < stages; ++stage) {
    for (int i = 0; i < convolutions_in_stage[stage]; ++i) {
      weights.convolutions.push_back(read_convolution(file, path.string(), places[next++], channels));
      channels = weights.convolutions.back().bias.size();
    }
    weights.linear.push_back(read_linear(file, path.string(), stage, channels));
  }
  return weights;
}

Device Network::device() const { return convolutions.at(0).matrix.device(); }

Network Network::on(Device device) const {
  Network there;
  for (const Convolution& c : convolutions) {
    there.convolutions.push_back({c.matrix.on(device), c.bias.on(device)});
  }
  for (const Tensor<float>& l : linear) there.linear.push_back(l.on(device));
  return there;
}

Network network_of(const Weights& weights) {
  Network network;
  for (const Weights::Convolution& convolution : weights.convolutions) {
    const int64_t outputs = convolution.weight.dim(0), inputs = convolution.weight.dim(1);
    Tensor<float> matrix;
    matrix.resize({9 * inputs, outputs});
    for (int64_t o = 0; o < outputs; ++o) {
      for (int64_t c = 0; c < inputs; ++c) {
        for (int64_t k = 0; k < 9; ++k) {
          matrix(k * inputs + c, o) = convolution.weight[(o * inputs + c) * 9 + k];
        }
      }
    }
    network.convolutions.push_back({std::move(matrix), convolution.bias});
  }
  network.linear = weights.linear;
  return network;
}

}  // namespace traceflow::lpips
