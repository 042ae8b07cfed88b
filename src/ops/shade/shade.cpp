#include "ops/shade/shade.h"

#include "base/indices.h"
#include "base/parallel.h"
#include "ops/shade/shade_kernels.h"

namespace traceflow::shade {

namespace {

constexpr int64_t pixels_per_block = 4096;

template <class T>
void check_shapes(const Tensor<T>& diffuse, const Tensor<T>& tint, const Tensor<int32_t>& pixels,
                  const Tensor<T>& specular) {
  require(diffuse.size() == 3 * tint.size(), "diffuse and tint show the same picture",
          diffuse.shape().to_string());
  require(specular.size() == 3 * pixels.size(), "every traced pixel has a specular colour",
          specular.shape().to_string());
  require_ascending(pixels, tint.size());
}

}  // namespace

template <class T>
void forward(const Tensor<T>& diffuse, const Tensor<T>& tint, const Tensor<int32_t>& pixels,
             const Tensor<T>& specular, Tensor<T>& colour) {
  check_shapes(diffuse, tint, pixels, specular);
  colour = diffuse;
  parallel_for(diffuse.device(), "shade: blend", pixels.size(),
               Blend<T>{pixels.data(), diffuse.data(), tint.data(), specular.data(), colour.data()},
               pixels_per_block);
}

template <class T>
void backward(const Tensor<T>& diffuse, const Tensor<T>& tint, const Tensor<int32_t>& pixels,
              const Tensor<float>& weights, const Tensor<T>& specular, const Tensor<T>& grad_colour,
              Tensor<T>& grad_diffuse, Tensor<T>& grad_tint, Tensor<T>& grad_specular) {
  check_shapes(diffuse, tint, pixels, specular);
  require(weights.size() == pixels.size() && grad_colour.shape() == diffuse.shape() &&
              grad_tint.size() == tint.size(),
          "gradients have the shapes of their values", grad_colour.shape().to_string());
  grad_diffuse = grad_colour;
  grad_specular.place(diffuse.device()).resize({pixels.size(), 3});
  parallel_for(
      diffuse.device(), "shade: blend backward", pixels.size(),
      BlendBackward<T>{pixels.data(), weights.data(), diffuse.data(), tint.data(), specular.data(),
                       grad_colour.data(), grad_diffuse.data(), grad_tint.data(), grad_specular.data()},
      pixels_per_block);
}

template void forward(const Tensor<float>&, const Tensor<float>&, const Tensor<int32_t>&,
                      const Tensor<float>&, Tensor<float>&);
template void forward(const Tensor<double>&, const Tensor<double>&, const Tensor<int32_t>&,
                      const Tensor<double>&, Tensor<double>&);
template void backward(const Tensor<float>&, const Tensor<float>&, const Tensor<int32_t>&,
                       const Tensor<float>&, const Tensor<float>&, const Tensor<float>&, Tensor<float>&,
                       Tensor<float>&, Tensor<float>&);
template void backward(const Tensor<double>&, const Tensor<double>&, const Tensor<int32_t>&,
                       const Tensor<float>&, const Tensor<double>&, const Tensor<double>&, Tensor<double>&,
                       Tensor<double>&, Tensor<double>&);

}  // namespace traceflow::shade
