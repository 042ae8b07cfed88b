#include "prepare/motion/track.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace traceflow::prepare {

namespace {

constexpr int64_t smallest_side = 16;
constexpr int radius = 5;  // of the compared window
constexpr int window = (2 * radius + 1) * (2 * radius + 1);
constexpr int iterations = 12;
constexpr double converged = 0.02;         // pixels
constexpr double farthest_back = 0.5;      // pixels
constexpr double largest_difference = 20;  // mean over the window, of 255
constexpr double least_contrast = 8;       // gradient², mean over the window, in its smallest direction

Tensor<float> half_of(const Tensor<float>& image) {
  constexpr std::array<float, 5> weights{1 / 16.0F, 4 / 16.0F, 6 / 16.0F, 4 / 16.0F, 1 / 16.0F};
  const int64_t height = image.dim(0), width = image.dim(1);
  const auto inside = [](int64_t i, int64_t size) { return std::clamp<int64_t>(i, 0, size - 1); };
  Tensor<float> narrow({height, (width + 1) / 2});
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < narrow.dim(1); ++x) {
      for (int64_t k = 0; k < 5; ++k)
        narrow(y, x) += weights[static_cast<size_t>(k)] * image(y, inside(2 * x + k - 2, width));
    }
  }
  Tensor<float> half({(height + 1) / 2, narrow.dim(1)});
  for (int64_t y = 0; y < half.dim(0); ++y) {
    for (int64_t k = 0; k < 5; ++k) {
      const float* row = narrow.row(inside(2 * y + k - 2, height));
      for (int64_t x = 0; x < half.dim(1); ++x) half(y, x) += weights[static_cast<size_t>(k)] * row[x];
    }
  }
  return half;
}

// Bilinear; the border is replicated.
double sample(const Tensor<float>& image, double x, double y) {
  const double inside_x = std::clamp(x, 0.0, static_cast<double>(image.dim(1) - 1));
  const double inside_y = std::clamp(y, 0.0, static_cast<double>(image.dim(0) - 1));
  const auto i = std::min(static_cast<int64_t>(inside_x), std::max<int64_t>(0, image.dim(1) - 2));
  const auto j = std::min(static_cast<int64_t>(inside_y), std::max<int64_t>(0, image.dim(0) - 2));
  const int64_t right = std::min(i + 1, image.dim(1) - 1), below = std::min(j + 1, image.dim(0) - 1);
  const double u = inside_x - static_cast<double>(i), v = inside_y - static_cast<double>(j);
  return (1 - v) * ((1 - u) * image(j, i) + u * image(j, right)) +
         v * ((1 - u) * image(below, i) + u * image(below, right));
}

Vec2<double> gradient(const Tensor<float>& image, double x, double y) {
  return {0.5 * (sample(image, x + 1, y) - sample(image, x - 1, y)),
          0.5 * (sample(image, x, y + 1) - sample(image, x, y - 1))};
}

using Structure = glm::dmat2;  // sum of the products of gradients over a window

double least_eigenvalue(const Structure& m) {
  return 0.5 * (m[0][0] + m[1][1] - std::hypot(m[0][0] - m[1][1], 2 * m[0][1]));
}

// The surroundings of a point on one level.
struct Patch {
  std::array<double, window> value;
  std::array<Vec2<double>, window> slope;
  Structure structure{0};

  Patch(const Tensor<float>& image, const Vec2<double>& at) {
    size_t k = 0;
    for (int dy = -radius; dy <= radius; ++dy) {
      for (int dx = -radius; dx <= radius; ++dx, ++k) {
        value[k] = sample(image, at.x + dx, at.y + dy);
        slope[k] = gradient(image, at.x + dx, at.y + dy);
        structure += outerProduct(slope[k], slope[k]);
      }
    }
  }
};

// Calls f(k, difference) over the window around `at`. Returns the mean absolute difference.
template <class F>
double compare(const Patch& patch, const Tensor<float>& image, const Vec2<double>& at, F&& f) {
  double sum = 0;
  size_t k = 0;
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx, ++k) {
      const double difference = patch.value[k] - sample(image, at.x + dx, at.y + dy);
      sum += std::abs(difference);
      f(k, difference);
    }
  }
  return sum / window;
}

// Starts at the coarsest of `levels`; `shift` is in pixels.
std::optional<Track> follow(const Pyramid& from, const Pyramid& to, const Vec2<double>& place, size_t levels,
                            Vec2<double> shift) {
  shift /= static_cast<double>(int64_t{1} << levels);
  double difference = 0;
  for (size_t level = levels; level-- > 0;) {
    const Vec2<double> at = place / static_cast<double>(int64_t{1} << level);
    const Patch patch(from.levels[level], at);
    shift *= 2.0;
    if (least_eigenvalue(patch.structure) < least_contrast * window) {
      if (level == 0) return std::nullopt;
      continue;
    }
    for (int i = 0; i < iterations; ++i) {
      Vec2<double> b(0);
      compare(patch, to.levels[level], at + shift,
              [&](size_t k, double apart) { b += apart * patch.slope[k]; });
      const Vec2<double> step = inverse(patch.structure) * b;
      shift += step;
      if (dot(step, step) < converged * converged) break;
    }
    if (level == 0) difference = compare(patch, to.levels[0], at + shift, [](size_t, double) {});
  }
  const Vec2<double> found = place + shift;
  const bool inside = found.x >= 0 && found.y >= 0 && found.x <= static_cast<double>(to.width() - 1) &&
                      found.y <= static_cast<double>(to.height() - 1);
  if (!inside || difference > largest_difference) return std::nullopt;
  return Track{place, found, difference};
}

}  // namespace

Pyramid make_pyramid(Tensor<float> grey) {
  Pyramid pyramid;
  pyramid.levels.push_back(std::move(grey));
  while (std::min(pyramid.levels.back().dim(0), pyramid.levels.back().dim(1)) >= 2 * smallest_side) {
    pyramid.levels.push_back(half_of(pyramid.levels.back()));
  }
  return pyramid;
}

std::vector<Vec2<double>> find_corners(const Pyramid& picture, int spacing) {
  constexpr int step = 2, half_window = 3;
  const Tensor<float>& image = picture.levels.front();
  std::vector<Vec2<double>> corners;
  for (int64_t top = 0; top + spacing <= image.dim(0); top += spacing) {
    for (int64_t left = 0; left + spacing <= image.dim(1); left += spacing) {
      double best = least_contrast * (2 * half_window + 1) * (2 * half_window + 1);
      std::optional<Vec2<double>> corner;
      for (int64_t y = top; y < top + spacing; y += step) {
        for (int64_t x = left; x < left + spacing; x += step) {
          Structure around{0};
          for (int64_t dy = -half_window; dy <= half_window; ++dy) {
            for (int64_t dx = -half_window; dx <= half_window; ++dx) {
              const Vec2<double> g =
                  gradient(image, static_cast<double>(x + dx), static_cast<double>(y + dy));
              around += outerProduct(g, g);
            }
          }
          const double contrast = least_eigenvalue(around);
          if (contrast <= best) continue;
          best = contrast;
          corner = Vec2<double>(x, y);
        }
      }
      if (corner) corners.push_back(*corner);
    }
  }
  return corners;
}

std::vector<Track> track(const Pyramid& from, const Pyramid& to, const std::vector<Vec2<double>>& places) {
  std::vector<Track> tracks;
  for (const Vec2<double>& place : places) {
    const auto there = follow(from, to, place, from.levels.size(), Vec2<double>(0));
    if (!there) continue;
    const auto back = follow(to, from, there->to, to.levels.size(), Vec2<double>(0));
    if (back && length(back->to - place) <= farthest_back) tracks.push_back(*there);
  }
  return tracks;
}

std::optional<Track> track_near(const Pyramid& from, const Pyramid& to, const Vec2<double>& place,
                                const Vec2<double>& shift) {
  return follow(from, to, place, std::min<size_t>(2, from.levels.size()), shift);
}

}  // namespace traceflow::prepare
