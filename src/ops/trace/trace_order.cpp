#include "ops/trace/trace_order.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "ops/trace/trace_kernels.h"
#include "ops/trace/trace_ray_key.h"

namespace traceflow::trace {

namespace {

Vec3<float> median(std::vector<Vec3<float>> points) {
  if (points.empty()) return Vec3<float>(0);
  Vec3<float> result;
  for (int axis = 0; axis < 3; ++axis) {
    const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
    std::nth_element(points.begin(), middle, points.end(),
                     [axis](const Vec3<float>& a, const Vec3<float>& b) { return a[axis] < b[axis]; });
    result[axis] = (*middle)[axis];
  }
  return result;
}

// Medians of samples, which outliers among rays and surfels do not affect.
Vec3<float> typical_origin(const Rays& rays) {
  constexpr int64_t samples = 1000;
  std::vector<Vec3<float>> points;
  for (int64_t r = 0; r < rays.count(); r += std::max<int64_t>(1, rays.count() / samples)) {
    if (is_traceable(rays.origins.row(r), rays.directions.row(r)))
      points.push_back(load3<float>(rays.origins.row(r)));
  }
  return median(std::move(points));
}

float typical_distance(const Bvh& bvh, const Vec3<float>& from) {
  constexpr size_t samples = 1000;
  std::vector<float> distances;
  for (size_t i = 0; i < bvh.leaves.size(); i += std::max<size_t>(1, bvh.leaves.size() / samples)) {
    const auto& p = bvh.leaves[i].position;
    distances.push_back(glm::length(Vec3<float>(p[0][0], p[1][0], p[2][0]) - from));
  }
  if (distances.empty()) return 1;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return std::isfinite(*middle) && *middle > 0 ? *middle : 1;
}

struct Keyed {
  uint32_t key, ray;
};

// Stable, least significant digit first.
void radix_sort(std::vector<Keyed>& items) {
  constexpr int digit_bits = 11;
  constexpr uint32_t digits = 1U << digit_bits;
  std::vector<Keyed> other(items.size());
  for (int shift = 0; shift < 31; shift += digit_bits) {
    std::array<uint32_t, digits> next{};
    for (const Keyed& item : items) ++next[item.key >> shift & (digits - 1)];
    uint32_t sum = 0;
    for (uint32_t& n : next) {
      const uint32_t count = n;
      n = sum;
      sum += count;
    }
    for (const Keyed& item : items) other[next[item.key >> shift & (digits - 1)]++] = item;
    items.swap(other);
  }
}

// The curve has jumps. So the rays of a section are grouped again, to keep the rays of a packet close
// together.
constexpr int64_t section_rays = 1024;
constexpr int64_t group_rays = 16;  // a multiple of the size of every packet

// The position of a ray at its origin and at the typical distance of the surfels.
struct Way {
  float at[6];
  uint32_t ray;
};

// Cuts at the median of the widest coordinate until one group remains.
void group_ways(Way* begin, Way* end) {
  const int64_t groups = (end - begin + group_rays - 1) / group_rays;
  if (groups <= 1) return;
  float low[6], high[6];
  std::copy_n(begin->at, 6, low);
  std::copy_n(begin->at, 6, high);
  for (const Way* way = begin; way != end; ++way) {
    for (int k = 0; k < 6; ++k) {
      low[k] = std::min(low[k], way->at[k]);
      high[k] = std::max(high[k], way->at[k]);
    }
  }
  int widest = 0;
  for (int k = 1; k < 6; ++k) {
    if (high[k] - low[k] > high[widest] - low[widest]) widest = k;
  }
  Way* middle = begin + groups / 2 * group_rays;
  std::nth_element(begin, middle, end, [widest](const Way& a, const Way& b) {
    return a.at[widest] < b.at[widest] || (a.at[widest] == b.at[widest] && a.ray < b.ray);
  });
  group_ways(begin, middle);
  group_ways(middle, end);
}

void group_section(const RayView& rays, float sample_distance, uint32_t* begin, uint32_t* end) {
  constexpr float origin_weight = 0.3F;  // a beam is wide at one end only
  std::array<Way, section_rays> ways;
  Way* last = ways.data();
  for (const uint32_t* ray = begin; ray != end; ++ray) {
    UnitRay unit;
    make_unit_ray(rays, *ray, unit);
    store3(last->at, unit.origin + sample_distance * unit.direction);
    store3(last->at + 3, origin_weight * unit.origin);
    (last++)->ray = *ray;
  }
  group_ways(ways.data(), last);
  std::transform(ways.data(), last, begin, [](const Way& way) { return way.ray; });
}

}  // namespace

void order_rays(const Bvh& bvh, const Rays& rays, RayOrder& order) {
  const int64_t count = rays.count();
  order.ray.resize(static_cast<size_t>(count));
  if (count == 0) return;
  const RayView view(rays);
  const Vec3<float> centre = typical_origin(rays);
  order.sample_distance = typical_distance(bvh, centre);
  std::vector<Keyed> items(static_cast<size_t>(count));
  parallel_for("trace order", count, [&](int64_t r) {
    items[static_cast<size_t>(r)] = {ray_key(view, r, centre, order.sample_distance),
                                     static_cast<uint32_t>(r)};
  });
  radix_sort(items);
  std::transform(items.begin(), items.end(), order.ray.begin(), [](const Keyed& item) { return item.ray; });
  const auto traceable = std::partition_point(items.begin(), items.end(),
                                              [](const Keyed& item) { return item.key != untraceable_key; });
  parallel_blocks("trace group", traceable - items.begin(), section_rays, [&](int64_t begin, int64_t end) {
    group_section(view, order.sample_distance, &order.ray[static_cast<size_t>(begin)],
                  order.ray.data() + end);
  });
}

}  // namespace traceflow::trace
