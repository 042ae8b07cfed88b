#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "capture/synth/sampler.h"
#include "capture/synth/scene.h"
#include "capture/synth/synth.h"

namespace traceflow {

namespace {

using synth::Vector;

// Errors at prior_noise = 1.
constexpr double blur_per_width = 1.3 / 240;                 // standard deviation
constexpr double fixed_turn = 2.5 * std::numbers::pi / 180;  // of the whole capture
constexpr double view_turn = 1.5 * std::numbers::pi / 180;   // of one view, standard deviation
constexpr double warp = 4.0 * std::numbers::pi / 180;        // varies slowly over the image, maximum
constexpr double depth_warp = 0.04;                          // likewise, of the inverse depth

std::vector<double> gaussian_weights(double deviation) {
  const int radius = static_cast<int>(std::ceil(3 * deviation));
  std::vector<double> weights;
  for (int k = -radius; k <= radius; ++k) weights.push_back(std::exp(-0.5 * k * k / (deviation * deviation)));
  return weights;
}

// One direction of a separable blur; the border is replicated. step: (0, 1) along rows, (1, 0) along columns.
Tensor<float> blurred(const Tensor<float>& image, const std::vector<double>& weights, int64_t step_y,
                      int64_t step_x) {
  const auto radius = static_cast<int64_t>(weights.size() / 2);
  Tensor<float> result(image.shape());
  parallel_for(
      "blur prior", image.dim(0),
      [&](int64_t y) {
        for (int64_t x = 0; x < image.dim(1); ++x) {
          for (int64_t c = 0; c < image.dim(2); ++c) {
            double sum = 0;
            for (int64_t k = -radius; k <= radius; ++k) {
              const int64_t from_y = std::clamp<int64_t>(y + k * step_y, 0, image.dim(0) - 1);
              const int64_t from_x = std::clamp<int64_t>(x + k * step_x, 0, image.dim(1) - 1);
              sum += weights[static_cast<size_t>(k + radius)] * static_cast<double>(image(from_y, from_x, c));
            }
            result(y, x, c) = static_cast<float>(sum);
          }
        }
      },
      16);
  return result;
}

Vector random_axis(Random& random) {
  const Vector v(random.normal(), random.normal(), random.normal());
  return v / std::max(length(v), 1e-12);
}

// A sum of a few plane waves: a smooth field of small rotations, as axis · angle.
class SlowWarp {
 public:
  SlowWarp(Random& random, double largest) {
    for (Wave& wave : waves_) {
      wave.axis = (largest / waves) * random_axis(random);
      wave.frequency = {random.uniform(-9, 9), random.uniform(-9, 9)};
      wave.phase = random.uniform(0, 2 * std::numbers::pi);
    }
  }
  // Position in units of the image width.
  Vector at(const Vec2<double>& position) const {
    Vector sum(0);
    for (const Wave& wave : waves_) sum += wave.axis * std::sin(dot(wave.frequency, position) + wave.phase);
    return sum;
  }

 private:
  static constexpr int waves = 4;
  struct Wave {
    Vector axis{0};
    Vec2<double> frequency{0};
    double phase = 0;
  };
  Wave waves_[waves];
};

Tensor<float> blurred_as_prior(const SynthOptions& options, const Tensor<float>& image) {
  const double noise = options.prior_noise;
  const std::vector<double> weights = gaussian_weights(noise * blur_per_width * options.width);
  return blurred(blurred(image, weights, 0, 1), weights, 1, 0);
}

Random random_of(uint64_t key, const SynthView& view) {
  return Random(synth::combine_bits(key, static_cast<uint64_t>(view.frame) * 2 + (view.is_test ? 1 : 0)));
}

// From world axes to the priors' camera space: OpenCV's with y and z negated.
Tensor<float> in_prior_space(const Camera<double>& camera, const Tensor<float>& normal) {
  Tensor<float> result(normal.shape());
  for (int64_t i = 0; i < normal.size(); i += 3) {
    const Vector n = camera.camera_from_world * load3<double>(normal.data() + i);
    store3(result.data() + i, Vector(n.x, -n.y, -n.z));
  }
  return result;
}

}  // namespace

Tensor<float> synth_normal_prior(const SynthOptions& options, const SynthView& view,
                                 const Tensor<float>& normal) {
  Tensor<float> prior = in_prior_space(view.camera, normal);
  const double noise = options.prior_noise;
  if (noise == 0) return prior;

  prior = blurred_as_prior(options, prior);
  const uint64_t key = synth::combine_bits(static_cast<uint64_t>(options.seed), 0x7072696F72);
  Random of_capture(key);
  Random of_view = random_of(key, view);
  const Mat3<double> turn =
      synth::rotation_about(random_axis(of_view), noise * view_turn * of_view.normal()) *
      synth::rotation_about(random_axis(of_capture), noise * fixed_turn);
  const SlowWarp slow_warp(of_view, noise * warp);
  for (int64_t y = 0; y < prior.dim(0); ++y) {
    for (int64_t x = 0; x < prior.dim(1); ++x) {
      const Vec2<double> position(static_cast<double>(x) / options.width,
                                  static_cast<double>(y) / options.width);
      const Vector n = turn * load3<double>(&prior(y, x, 0));
      const Vector warped = n + cross(slow_warp.at(position), n);
      const double size = length(warped);
      store3(&prior(y, x, 0), size > 1e-6 ? warped / size : Vector(0, 0, 1));
    }
  }
  return prior;
}

Tensor<float> synth_inverse_depth(const SynthOptions& options, const SynthView& view,
                                  const Tensor<float>& depth) {
  Tensor<float> inverse({depth.dim(0), depth.dim(1), 1});
  for (int64_t i = 0; i < depth.size(); ++i) inverse[i] = 1 / depth[i];
  if (const double noise = options.prior_noise; noise > 0) {
    inverse = blurred_as_prior(options, inverse);
    Random random = random_of(synth::combine_bits(static_cast<uint64_t>(options.seed), 0x6465707468), view);
    const SlowWarp slow_warp(random, noise * depth_warp);
    for (int64_t i = 0; i < inverse.size(); ++i) {
      const int64_t y = i / depth.dim(1), x = i % depth.dim(1);
      const Vec2<double> position(static_cast<double>(x) / options.width,
                                  static_cast<double>(y) / options.width);
      const double error = slow_warp.at(position).x;
      inverse[i] = static_cast<float>(inverse[i] * (1 + error));
    }
  }
  const auto [least, most] = std::ranges::minmax(inverse.values());
  for (float& value : inverse.values()) value = (value - least) / (most - least);
  inverse.resize(depth.shape());
  return inverse;
}

}  // namespace traceflow
