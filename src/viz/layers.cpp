#include "viz/layers.h"

#include <algorithm>
#include <sstream>

#include "base/parallel.h"
#include "viz/ellipses.h"
#include "viz/track_picture.h"

namespace traceflow::viz {

namespace {

Tensor<float> divided(Tensor<float> depth, double scale) {
  for (float& z : depth.values()) z = static_cast<float>(z / scale);
  return depth;
}

}  // namespace

bool has_colours(Layer layer) {
  constexpr std::array<Layer, 6> colours = {Layer::rgb,    Layer::diffuse, Layer::specular,
                                            Layer::normal, Layer::surfels, Layer::tracks};
  return std::ranges::find(colours, layer) != colours.end();
}

bool needs_reflections(Layer layer) {
  return layer == Layer::rgb || layer == Layer::specular || layer == Layer::tracks;
}

std::vector<Layer> parse_layers(const std::string& list) {
  std::vector<Layer> layers;
  std::istringstream words(list);
  for (std::string word; std::getline(words, word, ',');) {
    const auto* const found = std::ranges::find(layer_names, word);
    const bool all = word == "all";
    if (found == layer_names.end() && !all) {
      std::string expected;
      for (const char* name : layer_names) expected += std::string(name) + ", ";
      throw InputError("option", "layers", word, expected + "or all, with commas between");
    }
    for (size_t i = 0; i < layer_names.size(); ++i) {
      const auto layer = static_cast<Layer>(i);
      const bool wanted = all || layer_names[i] == word;
      if (wanted && std::ranges::find(layers, layer) == layers.end()) layers.push_back(layer);
    }
  }
  if (layers.empty()) throw InputError("option", "layers", "none", "at least one");
  return layers;
}

Tensor<float> layer_values(const Frame& frame, Layer layer, double scale, const Tracks& tracks) {
  switch (layer) {
    case Layer::rgb:
      return frame.colour.on(Device::cpu);
    case Layer::diffuse:
      return frame.raster.colour.on(Device::cpu);
    case Layer::specular:
      return frame.specular_image().on(Device::cpu);
    case Layer::tint:
      return frame.raster.tint.on(Device::cpu);
    case Layer::roughness:
      return frame.raster.roughness.empty() ? Tensor<float>(frame.raster.alpha.shape())
                                            : frame.raster.roughness.on(Device::cpu);
    case Layer::alpha:
      return frame.raster.alpha.on(Device::cpu);
    case Layer::normal:
      return frame.raster.normal.on(Device::cpu);
    case Layer::depth:
      return divided(frame.raster.depth.on(Device::cpu), scale);
    case Layer::median_depth:
      return divided(frame.raster.median_depth.on(Device::cpu), scale);
    case Layer::distortion:
      return frame.raster.distortion.on(Device::cpu);
    case Layer::surfels:
      return surfel_ellipses(frame.main, frame.camera, frame.drawn_with);
    case Layer::tracks:
      return track_picture(frame, tracks);
  }
  return {};
}

Tensor<float> difference_values(const Frame& frame, const Tensor<float>& photograph,
                                const Tensor<uint8_t>& known) {
  require(photograph.shape() == frame.colour.shape(), "photograph and render have one shape",
          photograph.shape().to_string() + " and " + frame.colour.shape().to_string());
  Tensor<float> fetched;
  const Tensor<float>& render = on_host(frame.colour, fetched);
  Tensor<float> difference(Shape{render.dim(0), render.dim(1)});
  parallel_for("show: difference", difference.size(), [&](int64_t i) {
    if (!known.empty() && known[i] == 0) return;
    const Vec3<float> d = abs(load3<float>(photograph.data() + 3 * i) - load3<float>(render.data() + 3 * i));
    difference[i] = (d.x + d.y + d.z) / 3;
  });
  return difference;
}

}  // namespace traceflow::viz
