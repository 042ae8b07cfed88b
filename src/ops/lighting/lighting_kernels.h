#pragma once

#include <cstdint>

#include "math/spherical_harmonics.h"
#include "ops/lighting/lighting.h"
#include "ops/motion/key_span.h"
#include "ops/motion/motion_kernels.h"

// The steps of lighting, on either device.
namespace traceflow::lighting {

// A colour is the sum of its harmonics plus a half.
inline constexpr float half_in_harmonics = static_cast<float>(0.5 / sh_c0);

struct GridSize {
  int64_t x, y, z;

  TRACEFLOW_HD int64_t points() const { return x * y * z; }
  TRACEFLOW_HD int64_t at(int64_t column, int64_t row, int64_t layer) const {
    return (layer * y + row) * x + column;
  }
  // Offset of corner k of a cell, of eight, from the corner with the lowest coordinates.
  TRACEFLOW_HD int64_t corner(int k) const { return at(k & 1, (k >> 1) & 1, k >> 2); }
};

// Where a surfel is in the grid or on a body.
struct Place {
  int32_t cell = -1;  // the cell's corner with the lowest coordinates; −2 − b on body b; −1 if neither
  Vec3<float> share{0};  // position in the cell, 0 to 1; on a body: offset from its centre, in radii
  float gain = 1;

  TRACEFLOW_HD static int32_t cell_of_body(int32_t body) { return -2 - body; }
  // Negative if on no body.
  TRACEFLOW_HD int32_t body() const { return -2 - cell; }

  TRACEFLOW_HD float weight(int corner) const {
    return ((corner & 1) != 0 ? share.x : 1 - share.x) * ((corner & 2) != 0 ? share.y : 1 - share.y) *
           ((corner & 4) != 0 ? share.z : 1 - share.z);
  }
  // ∂weight/∂share.
  TRACEFLOW_HD Vec3<float> slope(int corner) const {
    const float wx = (corner & 1) != 0 ? share.x : 1 - share.x,
                wy = (corner & 2) != 0 ? share.y : 1 - share.y,
                wz = (corner & 4) != 0 ? share.z : 1 - share.z;
    return {((corner & 1) != 0 ? 1.0F : -1.0F) * wy * wz, ((corner & 2) != 0 ? 1.0F : -1.0F) * wx * wz,
            ((corner & 4) != 0 ? 1.0F : -1.0F) * wx * wy};
  }
};

// The grid at one time.
struct Grid {
  GridSize size;
  const float* box;
  const float *times, *brightness;
  int64_t keys;
  double time;

  TRACEFLOW_HD motion::KeySpan<float> span() const { return {times, keys, time}; }
  TRACEFLOW_HD float at(const motion::KeySpan<float>& span, int64_t point) const {
    const auto share = static_cast<float>(span.share);
    return (1 - share) * brightness[span.from * size.points() + point] +
           share * brightness[span.to * size.points() + point];
  }
  // Cells per unit of length.
  TRACEFLOW_HD Vec3<float> density() const {
    return Vec3<float>(static_cast<float>(size.x - 1), static_cast<float>(size.y - 1),
                       static_cast<float>(size.z - 1)) /
           (load3<float>(box + 3) - load3<float>(box));
  }
  TRACEFLOW_HD Place place_of(const Vec3<float>& point) const {
    const Vec3<float> at = (point - load3<float>(box)) * density();
    Place place;
    const bool is_inside = at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x < static_cast<float>(size.x - 1) &&
                           at.y < static_cast<float>(size.y - 1) && at.z < static_cast<float>(size.z - 1);
    if (!is_inside) return place;
    const auto x = static_cast<int64_t>(at.x), y = static_cast<int64_t>(at.y), z = static_cast<int64_t>(at.z);
    place.cell = static_cast<int32_t>(size.at(x, y, z));
    place.share = at - Vec3<float>(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
    float sum = 0;
    const motion::KeySpan<float> keys_now = span();
    for (int k = 0; k < 8; ++k) sum += place.weight(k) * this->at(keys_now, place.cell + size.corner(k));
    place.gain = std::exp(sum);
    return place;
  }
};

// The bodies at one time.
struct Bodies {
  const float *centre, *radius, *brightness;
  int64_t count;  // 0: the light on bodies is constant

  // Index of body b at key k.
  TRACEFLOW_HD static int64_t at(int64_t b, int64_t keys, int64_t k) { return b * keys + k; }
  TRACEFLOW_HD Vec3<float> slope(const Grid& grid, const motion::KeySpan<float>& span, int32_t b) const {
    const auto share = static_cast<float>(span.share);
    return (1 - share) * load3<float>(brightness + 4 * at(b, grid.keys, span.from) + 1) +
           share * load3<float>(brightness + 4 * at(b, grid.keys, span.to) + 1);
  }
  TRACEFLOW_HD Place place_of(const Grid& grid, int32_t b, const Vec3<float>& point) const {
    Place place;
    if (b >= count) return place;
    const motion::KeySpan<float> span = grid.span();
    const auto share = static_cast<float>(span.share);
    const int64_t from = at(b, grid.keys, span.from), to = at(b, grid.keys, span.to);
    const Vec3<float> now =
        (1 - share) * load3<float>(centre + 3 * from) + share * load3<float>(centre + 3 * to);
    place.cell = Place::cell_of_body(b);
    place.share = (point - now) / radius[b];
    place.gain = std::exp((1 - share) * brightness[4 * from] + share * brightness[4 * to] +
                          dot(slope(grid, span, b), place.share));
    return place;
  }
};

struct LightSurfel {
  Grid grid;
  Bodies bodies;
  motion::CarrierOf carrier;  // body null: there are no bodies
  const float* position;
  float* sh;
  int64_t numbers;  // of harmonics per surfel
  Place* places;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const int32_t body = carrier.body == nullptr ? -1 : carrier(i);
    const Vec3<float> point = load3<float>(position + 3 * i);
    const Place place = body >= 0 ? bodies.place_of(grid, body, point) : grid.place_of(point);
    places[i] = place;
    if (place.gain == 1) return;  // unchanged, to the bit
    float* const harmonics = sh + i * numbers;
    for (int64_t k = 0; k < numbers; ++k) {
      const float half = k < 3 ? half_in_harmonics : 0;
      harmonics[k] = place.gain * (harmonics[k] + half) - half;
    }
  }
};

// Turns surfel i's gradient into that before lighting, and writes the gradient by the logarithm of the light
// there to log_gradients.
struct LightBack {
  Grid grid;
  Bodies bodies;
  const Place* places;
  const float* lit;  // harmonics
  int64_t numbers;
  float *grad_sh, *grad_position;
  float* log_gradients;
  int32_t* cells;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const Place place = places[i];
    log_gradients[i] = 0;
    cells[i] = -1;
    if (place.cell == -1) return;
    double log_gradient = 0;
    for (int64_t k = i * numbers; k < (i + 1) * numbers; ++k) {
      const float half = k < i * numbers + 3 ? half_in_harmonics : 0;
      log_gradient += static_cast<double>(grad_sh[k]) * (lit[k] + half);
      grad_sh[k] *= place.gain;
    }
    if (!(log_gradient * 0 == 0) || log_gradient == 0) return;
    log_gradients[i] = static_cast<float>(log_gradient);
    const motion::KeySpan<float> span = grid.span();
    if (const int32_t b = place.body(); b >= 0) {
      add3(grad_position + 3 * i,
           Vec3<double>(log_gradients[i] / bodies.radius[b] * bodies.slope(grid, span, b)));
      return;
    }
    cells[i] = place.cell;
    Vec3<float> slope(0);
    for (int k = 0; k < 8; ++k) slope += grid.at(span, place.cell + grid.size.corner(k)) * place.slope(k);
    add3(grad_position + 3 * i, Vec3<double>(log_gradients[i] * (slope * grid.density())));
  }
};

// Sums at a point the gradients from the surfels in the cells around it.
struct CollectAtPoint {
  Grid grid;
  const int32_t *begin, *entry;  // the surfels of each cell
  const Place* places;
  const float* log_gradients;
  float* grad_brightness;

  TRACEFLOW_HD void operator()(int64_t point) const {
    const int64_t column = point % grid.size.x, row = point / grid.size.x % grid.size.y,
                  layer = point / grid.size.x / grid.size.y;
    double sum = 0;
    for (int k = 0; k < 8; ++k) {
      if (column < (k & 1) || row < ((k >> 1) & 1) || layer < (k >> 2)) continue;
      const int64_t cell = point - grid.size.corner(k);
      for (int32_t e = begin[cell]; e < begin[cell + 1]; ++e)
        sum += static_cast<double>(places[entry[e]].weight(k)) * log_gradients[entry[e]];
    }
    if (sum == 0) return;
    const motion::KeySpan<float> span = grid.span();
    grad_brightness[span.from * grid.size.points() + point] += static_cast<float>((1 - span.share) * sum);
    grad_brightness[span.to * grid.size.points() + point] += static_cast<float>(span.share * sum);
  }
};

// The gradient of a body's four numbers.
struct BodyGradient {
  double at_centre = 0;
  Vec3<double> slope{0};

  TRACEFLOW_HD BodyGradient& operator+=(const BodyGradient& other) {
    at_centre += other.at_centre;
    slope += other.slope;
    return *this;
  }
};
struct BodyGradientOfSurfel {
  int32_t which;
  const Place* places;
  const float* log_gradients;

  TRACEFLOW_HD BodyGradient operator()(int64_t i) const {
    const double log_gradient = log_gradients[i];
    if (places[i].body() != which || log_gradient == 0) return {};
    return {log_gradient, log_gradient * Vec3<double>(places[i].share)};
  }
};
struct AddBodyGradient {
  Grid grid;
  float* gradient;  // of the body's keys

  TRACEFLOW_HD void operator()(const BodyGradient& sum) const {
    const motion::KeySpan<float> span = grid.span();
    add(span.from, 1 - span.share, sum);
    add(span.to, span.share, sum);
  }
  TRACEFLOW_HD void add(int64_t key, double share, const BodyGradient& sum) const {
    gradient[4 * key] += static_cast<float>(share * sum.at_centre);
    add3(gradient + 4 * key + 1, share * sum.slope);
  }
};

// A row of points along x, so that indices are divided once per row and not per point.
struct ResistAlongRow {
  GridSize size;
  int64_t keys;
  Stiffness weights;
  const float* brightness;
  float* gradient;

  // i: a row at a time.
  TRACEFLOW_HD void operator()(int64_t i) const {
    const int64_t row = i % size.y, layer = i / size.y % size.z, key = i / size.y / size.z;
    const int64_t begin = i * size.x, end = begin + size.x;
    if (row == 0 || layer == 0 || row + 1 == size.y || layer + 1 == size.z) {
      for (int64_t at = begin; at < end; ++at) gradient[at] = 0;
      return;
    }
    gradient[begin] = gradient[end - 1] = 0;
    // At the first and the last time a point is its own neighbour, which adds nothing.
    const int64_t before = key > 0 ? size.points() : 0, after = key + 1 < keys ? size.points() : 0;
    const int64_t across = size.at(0, 1, 0), up = size.at(0, 0, 1);
    for (int64_t at = begin + 1; at + 1 < end; ++at) {
      const double here = brightness[at];
      double sum = weights.size * here;
      sum += weights.haste * (here - brightness[at - before]);
      sum += weights.haste * (here - brightness[at + after]);
      for (const int64_t step : {int64_t{1}, across, up})
        sum += weights.roughness * (2 * here - brightness[at - step] - brightness[at + step]);
      gradient[at] += static_cast<float>(sum);
    }
  }
};

// i: a number of a body at a time.
struct ResistOnBody {
  int64_t keys;
  Stiffness weights;
  const float* brightness;
  float* gradient;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const int64_t key = i / 4 % keys;
    const double here = brightness[i];
    double sum = weights.size * here;
    if (key > 0) sum += weights.haste * (here - brightness[i - 4]);
    if (key + 1 < keys) sum += weights.haste * (here - brightness[i + 4]);
    gradient[i] += static_cast<float>(sum);
  }
};

}  // namespace traceflow::lighting
