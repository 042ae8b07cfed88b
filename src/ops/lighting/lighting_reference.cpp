#include <algorithm>
#include <cmath>

#include "math/spherical_harmonics.h"
#include "ops/lighting/lighting.h"
#include "ops/motion/key_span.h"

namespace traceflow::lighting {

namespace {

void light_surfel(BasicPosedSurfels<double>& posed, int64_t i, double logarithm) {
  for (int64_t k = 0; k < posed.sh.dim(1); ++k) {
    const double half = k == 0 ? 0.5 / sh_c0 : 0;
    for (int64_t c = 0; c < 3; ++c)
      posed.sh(i, k, c) = std::exp(logarithm) * (posed.sh(i, k, c) + half) - half;
  }
}

}  // namespace

// Follows the definition: interpolates the grid's points by products of hat functions.
void forward_reference(const BasicLighting<double>& lighting, const Tensor<int32_t>& body, double time,
                       BasicPosedSurfels<double>& posed) {
  const motion::KeySpan<double> span(lighting.time.data(), lighting.times(), time);
  const Shape& shape = lighting.brightness.shape();
  const auto at_point = [&](int64_t l, int64_t z, int64_t y, int64_t x) {
    return lighting.brightness[((l * shape[1] + z) * shape[2] + y) * shape[3] + x];
  };
  const auto now = [&](const Tensor<double>& numbers, int64_t b, int64_t k) {
    return (1 - span.share) * numbers(b, span.from, k) + span.share * numbers(b, span.to, k);
  };
  for (int64_t i = 0; i < posed.count(); ++i) {
    if (!body.empty() && body[i] >= 0) {
      if (lighting.bodies() == 0) continue;
      double logarithm = now(lighting.body_brightness, body[i], 0);
      for (int64_t axis = 0; axis < 3; ++axis) {
        const double offset = posed.position(i, axis) - now(lighting.centre, body[i], axis);
        logarithm += now(lighting.body_brightness, body[i], axis + 1) * offset / lighting.radius[body[i]];
      }
      light_surfel(posed, i, logarithm);
      continue;
    }
    double at[3], logarithm = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double low = lighting.box(0, axis), high = lighting.box(1, axis);
      at[axis] = (posed.position(i, axis) - low) / (high - low) * static_cast<double>(shape[3 - axis] - 1);
    }
    const auto hat = [](double x, int64_t point) {
      return std::max(0.0, 1 - std::abs(x - static_cast<double>(point)));
    };
    bool is_inside = true;
    for (int axis = 0; axis < 3; ++axis)
      is_inside = is_inside && at[axis] >= 0 && at[axis] < static_cast<double>(shape[3 - axis] - 1);
    for (int64_t z = 0; is_inside && z < shape[1]; ++z) {
      for (int64_t y = 0; y < shape[2]; ++y) {
        for (int64_t x = 0; x < shape[3]; ++x) {
          const double there =
              (1 - span.share) * at_point(span.from, z, y, x) + span.share * at_point(span.to, z, y, x);
          logarithm += hat(at[0], x) * hat(at[1], y) * hat(at[2], z) * there;
        }
      }
    }
    light_surfel(posed, i, logarithm);
  }
}

double resist_reference(const BasicLighting<double>& lighting, const Stiffness& weights) {
  const Shape& shape = lighting.brightness.shape();
  const auto at = [&](int64_t l, int64_t z, int64_t y, int64_t x) {
    return lighting.brightness[((l * shape[1] + z) * shape[2] + y) * shape[3] + x];
  };
  double sum = 0;
  for (int64_t l = 0; l < shape[0]; ++l) {
    for (int64_t z = 0; z < shape[1]; ++z) {
      for (int64_t y = 0; y < shape[2]; ++y) {
        for (int64_t x = 0; x < shape[3]; ++x) {
          const double here = at(l, z, y, x);
          const auto add = [&](double weight, double other) {
            sum += weight * std::pow(other - here, 2) / 2;
          };
          add(weights.size, 0);
          if (l + 1 < shape[0]) add(weights.haste, at(l + 1, z, y, x));
          if (z + 1 < shape[1]) add(weights.roughness, at(l, z + 1, y, x));
          if (y + 1 < shape[2]) add(weights.roughness, at(l, z, y + 1, x));
          if (x + 1 < shape[3]) add(weights.roughness, at(l, z, y, x + 1));
        }
      }
    }
  }
  for (int64_t b = 0; b < lighting.bodies(); ++b) {
    for (int64_t l = 0; l < shape[0]; ++l) {
      for (int64_t k = 0; k < 4; ++k) {
        const double here = lighting.body_brightness(b, l, k);
        sum += weights.size * here * here / 2;
        if (l + 1 == shape[0]) continue;
        sum += weights.haste * std::pow(lighting.body_brightness(b, l + 1, k) - here, 2) / 2;
      }
    }
  }
  return sum;
}

}  // namespace traceflow::lighting
