#include "mesh/fusion.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "mesh/marching_cubes.h"
#include "ops/surface/surface_kernels.h"

namespace traceflow::mesh {

namespace {

// Five gigabytes of blocks.
constexpr int64_t most_blocks = 400'000;
constexpr float least_cosine = 0.1F;
constexpr const char* voxel_option = "mesh.voxel";
constexpr const char* size_remedy = "a larger mesh.voxel, or a mesh.max_depth";

// What of a view is surface.
struct ViewSurface {
  Tensor<float> depth;   // H×W; 0 where there is none
  Tensor<float> facing;  // H×W, −ray·n for the ray scaled to z = 1 and the unit normal
};

Vec3<float> pixel_point(const Camera<float>& camera, int64_t row, int64_t column, float depth) {
  return camera.position + depth * surface::pixel_ray(camera, row, column);
}

// Pixels with enough alpha, a depth and a normal that is not at a grazing angle.
ViewSurface opaque_surface(const DepthView& view, const FusionOptions& options) {
  const int64_t width = view.depth.dim(1);
  ViewSurface surface{Tensor<float>(view.depth.shape()), Tensor<float>(view.depth.shape())};
  parallel_for("mesh: opaque pixels", view.depth.size(), [&](int64_t i) {
    const float depth = view.depth[i];
    const Vec3<float> ray = surface::pixel_ray(view.camera, i / width, i % width);
    const Vec3<float> normal = load3<float>(view.normal.data() + 3 * i);
    const float facing = -dot(ray, normal) / length(normal);
    const bool is_near =
        depth > 0 && std::isfinite(depth) && (options.max_depth == 0 || depth <= options.max_depth);
    if (!(view.alpha[i] >= options.min_alpha) || !is_near || !(facing >= least_cosine * length(ray)) ||
        !std::isfinite(facing)) {
      return;
    }
    surface.depth[i] = depth;
    surface.facing[i] = facing;
  });
  return surface;
}

// Removes the pixels of which a neighbour's point is farther from their tangent plane than `truncation`.
// Comparing planes and not depths keeps surfaces that are seen at an angle.
void remove_jumps(const DepthView& view, float truncation, ViewSurface& surface) {
  const Tensor<float> depth = surface.depth;
  const int64_t height = depth.dim(0), width = depth.dim(1);
  parallel_for(
      "mesh: jumps of the depth", height,
      [&](int64_t y) {
        for (int64_t x = 0; x < width; ++x) {
          if (depth(y, x) == 0) continue;
          const Vec3<float> point = pixel_point(view.camera, y, x, depth(y, x));
          const Vec3<float> normal = normalize(load3<float>(view.normal.data() + 3 * (y * width + x)));
          for (const auto& [row, column] :
               {std::array{y - 1, x}, std::array{y + 1, x}, std::array{y, x - 1}, std::array{y, x + 1}}) {
            if (row < 0 || column < 0 || row >= height || column >= width || depth(row, column) == 0)
              continue;
            const Vec3<float> other = pixel_point(view.camera, row, column, depth(row, column));
            if (std::fabs(dot(normal, other - point)) > truncation) surface.depth(y, x) = 0;
          }
        }
      },
      8);
}

void sort_and_unite(std::vector<uint64_t>& keys) {
  std::ranges::sort(keys);
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
}

// The keys of all blocks within a truncation of the surface's points, ascending.
std::vector<uint64_t> blocks_near(const DepthView& view, const ViewSurface& surface, float truncation,
                                  float voxel) {
  constexpr int64_t rows_each = 8;
  const int64_t height = surface.depth.dim(0), width = surface.depth.dim(1);
  const float block = voxel * block_side;
  std::vector<std::vector<uint64_t>> parts(static_cast<size_t>((height + rows_each - 1) / rows_each));
  const auto place_of = [&](const Vec3<float>& point) {
    const Vec3<float> place = floor(point / block);
    const float farthest = std::max({std::fabs(place.x), std::fabs(place.y), std::fabs(place.z)});
    check_option(farthest < static_cast<float>(BlockGrid::most_places), voxel_option, voxel, size_remedy);
    return Vec3<int32_t>(place);
  };
  parallel_blocks("mesh: blocks near the surface", height, rows_each, [&](int64_t begin, int64_t end) {
    std::vector<uint64_t>& keys = parts[static_cast<size_t>(begin / rows_each)];
    Vec3<int32_t> last_low(0), last_high(-1);
    for (int64_t i = begin * width; i < end * width; ++i) {
      if (surface.depth[i] == 0) continue;
      const Vec3<float> point = pixel_point(view.camera, i / width, i % width, surface.depth[i]);
      const Vec3<int32_t> low = place_of(point - truncation), high = place_of(point + truncation);
      if (low == last_low && high == last_high) continue;
      last_low = low;
      last_high = high;
      for (int32_t z = low.z; z <= high.z; ++z) {
        for (int32_t y = low.y; y <= high.y; ++y) {
          for (int32_t x = low.x; x <= high.x; ++x) keys.push_back(BlockGrid::key_of({x, y, z}));
        }
      }
    }
    sort_and_unite(keys);
  });
  std::vector<uint64_t> all;
  for (const std::vector<uint64_t>& keys : parts) all.insert(all.end(), keys.begin(), keys.end());
  sort_and_unite(all);
  return all;
}

// A view's surface where a point projects to: between the centres of four pixels.
struct Sample {
  std::array<int64_t, 4> pixel{};
  std::array<float, 4> share{};

  float of(const Tensor<float>& image) const {
    float sum = 0;
    for (size_t k = 0; k < 4; ++k) sum += share[k] * image[pixel[k]];
    return sum;
  }
  Vec3<float> of_three(const Tensor<float>& image) const {
    Vec3<float> sum(0);
    for (size_t k = 0; k < 4; ++k) sum += share[k] * load3<float>(image.data() + 3 * pixel[k]);
    return sum;
  }
};

// Returns whether all four pixels are in the image and show the surface.
bool find_sample(const ViewSurface& surface, const Vec2<float>& at, Sample& sample) {
  const int64_t height = surface.depth.dim(0), width = surface.depth.dim(1);
  const float x = at.x - 0.5F, y = at.y - 0.5F;
  if (!(x >= 0 && y >= 0 && x < static_cast<float>(width - 1) && y < static_cast<float>(height - 1)))
    return false;
  const auto column = static_cast<int64_t>(x), row = static_cast<int64_t>(y);
  const float u = x - static_cast<float>(column), v = y - static_cast<float>(row);
  const int64_t first = row * width + column;
  sample.pixel = {first, first + 1, first + width, first + width + 1};
  sample.share = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
  return std::ranges::all_of(sample.pixel, [&](int64_t pixel) { return surface.depth[pixel] > 0; });
}

// Whether a block may project into the image. True for some that do not.
bool may_see(const Camera<float>& camera, const Block& block, float voxel) {
  const float radius = 0.87F * block_side * voxel;  // √3/2
  const Vec3<float> middle =
      voxel * (Vec3<float>(block.place * block_side) + 0.5F * static_cast<float>(block_side - 1));
  const Vec3<float> p = camera.point_in_camera(middle);
  if (p.z <= -radius) return false;
  if (p.z <= 2 * radius) return true;
  const Vec2<float> at = camera.project(p);
  const float across = radius / (p.z - radius);
  const float margin_x = camera.focal_x * across * (1 + std::fabs(p.x / p.z));
  const float margin_y = camera.focal_y * across * (1 + std::fabs(p.y / p.z));
  return at.x >= -margin_x && at.y >= -margin_y && at.x <= static_cast<float>(camera.width) + margin_x &&
         at.y <= static_cast<float>(camera.height) + margin_y;
}

// The weight of a distance in truncations, of which a voxel is `voxel`. It is full before the surface and to
// one voxel behind it, so that noise of the depth moves no surface. Farther behind it falls to 0: there a
// view takes for full what is not full beyond an edge of the surface, where other views know better.
float trust_behind(float distance, float voxel) {
  const float share = (1 + distance) / (1 - voxel);
  return share < 1 ? share * share : 1;
}

void add_view(const DepthView& view, const ViewSurface& surface, float truncation, float voxel,
              Block& block) {
  for (int i = 0; i < block_voxels; ++i) {
    const Vec3<int> offset(i % block_side, i / block_side % block_side, i / (block_side * block_side));
    const Vec3<float> at = voxel * Vec3<float>(block.place * block_side + offset);
    const Vec3<float> in_camera = view.camera.point_in_camera(at);
    Sample sample;
    if (!(in_camera.z > 0) || !find_sample(surface, view.camera.project(in_camera), sample)) continue;
    const float before = sample.of(surface.depth) - in_camera.z;  // along z
    const float ray = length(in_camera) / in_camera.z;
    if (before * ray < -truncation) continue;
    const float facing = sample.of(surface.facing);
    // From the tangent plane of the surface on the same ray.
    const float distance = before * facing / truncation;
    const float weight = trust_behind(distance, voxel / truncation) * facing / ray;
    if (!(weight > 0)) continue;
    const auto k = static_cast<size_t>(i);
    block.weight[k] += weight;
    block.distance[k] += (std::min(distance, 1.0F) - block.distance[k]) * (weight / block.weight[k]);
    // The colour of what is behind free space is not the voxel's.
    if (distance >= 1) continue;
    float* colour = block.colour.data() + 3 * k;
    block.colour_weight[k] += weight;
    add3(colour, (sample.of_three(view.colour) - load3<float>(colour)) * (weight / block.colour_weight[k]));
  }
}

}  // namespace

void FusionOptions::validate() const {
  check_option(voxel >= 0 && std::isfinite(voxel), voxel_option, voxel, "0 or more");
  check_option(resolution >= 8 && resolution <= 4096, "mesh.resolution", resolution, "8 to 4096");
  check_option(truncation >= 2 && truncation <= 32, "mesh.truncation", truncation, "2 to 32");
  check_option(max_depth >= 0 && std::isfinite(max_depth), "mesh.max_depth", max_depth, "0 or more");
  check_option(min_alpha > 0 && min_alpha <= 1, "mesh.min_alpha", min_alpha, "more than 0, at most 1");
  check_option(components >= 0, "mesh.components", components, "0 or more");
  check_option(min_triangles >= 0, "mesh.min_triangles", min_triangles, "0 or more");
}

Fusion::Fusion(const FusionOptions& options) : options_(options) {
  options_.validate();
  require(options_.voxel > 0, "voxels have a size");
}

void Fusion::integrate(const DepthView& view) {
  const Camera<float>& camera = view.camera;
  const Shape one{camera.height, camera.width}, three{camera.height, camera.width, 3};
  require(view.depth.shape() == one && view.alpha.shape() == one && view.normal.shape() == three &&
              view.colour.shape() == three,
          "a view's layers have its camera's size", view.depth.shape().to_string());
  const float voxel = options_.voxel, truncation = options_.truncation * voxel;
  ViewSurface surface = opaque_surface(view, options_);
  remove_jumps(view, truncation, surface);

  std::vector<uint64_t> keys = blocks_near(view, surface, truncation, voxel);
  std::erase_if(keys, [&](uint64_t key) { return grid_.has(key); });
  check_option(grid_.count() + static_cast<int64_t>(keys.size()) <= most_blocks, voxel_option, voxel,
               size_remedy);
  grid_.add(keys);
  parallel_for(
      "mesh: add a view", grid_.count(),
      [&](int64_t i) {
        if (may_see(camera, grid_[i], voxel)) add_view(view, surface, truncation, voxel, grid_[i]);
      },
      16);
}

TriangleMesh Fusion::extract() const {
  return without_small_components(zero_surface(grid_, options_.voxel), options_.components,
                                  options_.min_triangles);
}

}  // namespace traceflow::mesh
