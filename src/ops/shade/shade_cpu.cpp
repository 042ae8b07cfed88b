#include "base/indices.h"
#include "base/parallel.h"
#include "math/types.h"
#include "ops/shade/shade.h"

namespace traceflow::shade {

namespace {

constexpr int64_t pixels_per_block = 4096;

template <class T>
void check_shapes(const Tensor<T>& diffuse, const Tensor<T>& tint, std::span<const int32_t> pixels,
                  const Tensor<T>& specular) {
  require(diffuse.size() == 3 * tint.size(), "diffuse and tint show the same picture",
          diffuse.shape().to_string());
  require(specular.size() == 3 * static_cast<int64_t>(pixels.size()),
          "every traced pixel has a specular colour", specular.shape().to_string());
  require_ascending(pixels, tint.size());
}

}  // namespace

template <class T>
void forward(const Tensor<T>& diffuse, const Tensor<T>& tint, std::span<const int32_t> pixels,
             const Tensor<T>& specular, Tensor<T>& colour) {
  check_shapes(diffuse, tint, pixels, specular);
  colour = diffuse;
  parallel_for(
      "shade: blend", static_cast<int64_t>(pixels.size()),
      [&](int64_t i) {
        const int64_t pixel = pixels[static_cast<size_t>(i)];
        const Vec3<T> d = load3<T>(diffuse.data() + 3 * pixel);
        const Vec3<T> s = load3<T>(specular.data() + 3 * i);
        store3(colour.data() + 3 * pixel, (T(1) - tint[pixel]) * d + tint[pixel] * s);
      },
      pixels_per_block);
}

template <class T>
void backward(const Tensor<T>& diffuse, const Tensor<T>& tint, std::span<const int32_t> pixels,
              std::span<const float> weights, const Tensor<T>& specular, const Tensor<T>& grad_colour,
              Tensor<T>& grad_diffuse, Tensor<T>& grad_tint, Tensor<T>& grad_specular) {
  check_shapes(diffuse, tint, pixels, specular);
  require(weights.size() == pixels.size() && grad_colour.shape() == diffuse.shape() &&
              grad_tint.size() == tint.size(),
          "gradients have the shapes of their values", grad_colour.shape().to_string());
  grad_diffuse = grad_colour;
  grad_specular.resize({static_cast<int64_t>(pixels.size()), 3});
  parallel_for(
      "shade: blend backward", static_cast<int64_t>(pixels.size()),
      [&](int64_t i) {
        const int64_t pixel = pixels[static_cast<size_t>(i)];
        const T weight = static_cast<T>(weights[static_cast<size_t>(i)]);
        const Vec3<T> d = load3<T>(diffuse.data() + 3 * pixel);
        const Vec3<T> s = load3<T>(specular.data() + 3 * i);
        const Vec3<T> g = load3<T>(grad_colour.data() + 3 * pixel);
        store3(grad_diffuse.data() + 3 * pixel, (T(1) - tint[pixel]) * g);
        store3(grad_specular.row(i), weight * tint[pixel] * g);
        grad_tint[pixel] += weight * dot(g, s - d);
      },
      pixels_per_block);
}

template void forward(const Tensor<float>&, const Tensor<float>&, std::span<const int32_t>,
                      const Tensor<float>&, Tensor<float>&);
template void forward(const Tensor<double>&, const Tensor<double>&, std::span<const int32_t>,
                      const Tensor<double>&, Tensor<double>&);
template void backward(const Tensor<float>&, const Tensor<float>&, std::span<const int32_t>,
                       std::span<const float>, const Tensor<float>&, const Tensor<float>&, Tensor<float>&,
                       Tensor<float>&, Tensor<float>&);
template void backward(const Tensor<double>&, const Tensor<double>&, std::span<const int32_t>,
                       std::span<const float>, const Tensor<double>&, const Tensor<double>&, Tensor<double>&,
                       Tensor<double>&, Tensor<double>&);

}  // namespace traceflow::shade
