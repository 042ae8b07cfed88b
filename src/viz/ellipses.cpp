#include "viz/ellipses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "base/parallel.h"
#include "math/surfel_projection.h"
#include "scene/surfel_views.h"

// Disks are prepared in parallel and sorted into tiles in their own order; one thread processes each tile. A
// tile first finds the nearest disk of every pixel and then colours the pixels.
namespace traceflow::viz {

namespace {

constexpr int tile_side = 32;

// The first and last column and row of the pixels that a disk may cover; empty if last < first.
struct PixelBox {
  int left = 0, top = 0, right = -1, bottom = -1;

  bool empty() const { return right < left || bottom < top; }
  template <class F>
  void for_each_tile(int tiles_across, F&& f) const {
    if (empty()) return;
    for (int row = top / tile_side; row <= bottom / tile_side; ++row) {
      for (int column = left / tile_side; column <= right / tile_side; ++column)
        f(row * tiles_across + column);
    }
  }
};

// A linear form in a pixel's ray, written as a linear form in the pixel's coordinates.
struct PixelForm {
  double x = 0, y = 0, constant = 0;

  PixelForm() = default;
  PixelForm(const Vec3<double>& of_ray, const Camera<double>& camera)
      : x(of_ray.x / camera.focal_x),
        y(of_ray.y / camera.focal_y),
        constant(of_ray.z - x * camera.centre_x - y * camera.centre_y) {}
  double at(double pixel_x, double pixel_y) const { return x * pixel_x + y * pixel_y + constant; }
};

// A surfel in pixel coordinates (math/surfel_projection.h).
struct Disk {
  PixelForm u, v, w;
  double inverse_z_plane = 0;
  Vec3<float> colour{0};
  PixelBox box;
};

bool is_shown(const PosedSurfelsView& s, int64_t i) {
  return all_finite(s.position + 3 * i, 3) && all_finite(s.scale + 2 * i, 2) &&
         all_finite(s.rotation + 4 * i, 4) && all_finite(s.sh + s.sh_row * i, s.sh_row) &&
         (s.tint == nullptr || std::isfinite(s.tint[i])) && s.opacity[i] >= least_shown_opacity &&
         s.scale[2 * i] > 0 && s.scale[2 * i + 1] > 0;
}

// The pixels whose centres are in the bounding box of a projected octagon around the disk, clipped at the
// near plane. The box of a convex shape is the box of its corners.
PixelBox box_around(const SurfelFrame<double>& s, const Camera<double>& camera, double near_plane) {
  // For so large a disk, rounding would make the clipping at the plane meaningless.
  if (std::max(s.scale.x, s.scale.y) > 1e8 * near_plane) return {0, 0, camera.width - 1, camera.height - 1};
  constexpr int corners = 8;
  constexpr double half_turn = 3.14159265358979323846;
  const double radius = 1.0001 / std::cos(half_turn / corners);
  const Vec3<double> centre = camera.point_in_camera(s.position);
  const Vec3<double> along_u = s.scale.x * (camera.camera_from_world * s.rotation[0]);
  const Vec3<double> along_v = s.scale.y * (camera.camera_from_world * s.rotation[1]);
  std::array<Vec3<double>, corners> corner;
  for (int k = 0; k < corners; ++k) {
    const double angle = 2 * half_turn * k / corners;
    corner[static_cast<size_t>(k)] =
        centre + radius * (std::cos(angle) * along_u + std::sin(angle) * along_v);
  }
  Vec2<double> low(HUGE_VAL), high(-HUGE_VAL);
  const auto include = [&](const Vec3<double>& point) {
    const Vec2<double> pixel = camera.project(point);
    low = min(low, pixel);
    high = max(high, pixel);
  };
  const double nearest = 0.999 * near_plane;
  for (size_t k = 0; k < corners; ++k) {
    const Vec3<double>&a = corner[k], &b = corner[(k + 1) % corners];
    if (a.z >= nearest) include(a);
    if ((a.z >= nearest) != (b.z >= nearest)) include(mix(a, b, (nearest - a.z) / (b.z - a.z)));
  }
  // The centre of pixel i is at i + 0.5. A disk that is nowhere in front has no bounds and an empty box.
  const auto first = [](double v, int end) {
    return static_cast<int>(std::ceil(std::clamp(v - 0.5, 0.0, end + 0.0)));
  };
  const auto last = [](double v, int end) {
    return static_cast<int>(std::floor(std::clamp(v - 0.5, -1.0, end - 1.0)));
  };
  return {first(low.x, camera.width), first(low.y, camera.height), last(high.x, camera.width),
          last(high.y, camera.height)};
}

std::optional<Disk> prepare(const PosedSurfelsView& surfels, int64_t i, const Camera<double>& camera,
                            const raster::Options& options) {
  if (!is_shown(surfels, i)) return std::nullopt;
  const SurfelFrame<double> frame = surfel_frame(surfels, i);
  const Vec3<double> from_camera = frame.position - camera.position;
  const bool in_front = (camera.camera_from_world * from_camera).z >= options.near_plane;
  if (!in_front && options.sort == raster::SortOrder::centre) return std::nullopt;
  Disk disk;
  disk.box = box_around(frame, camera, options.near_plane);
  if (disk.box.empty()) return std::nullopt;
  const SurfelForms<double> forms = surfel_forms(frame, camera);
  if (!(forms.z_plane > 0)) return std::nullopt;  // seen edge-on
  disk.u = PixelForm(forms.u, camera);
  disk.v = PixelForm(forms.v, camera);
  disk.w = PixelForm(forms.w, camera);
  disk.inverse_z_plane = 1 / forms.z_plane;
  disk.colour = Vec3<float>(
      sh_colour<double>(surfels.sh_degree, surfels.sh + surfels.sh_row * i, normalize(from_camera)));
  return disk;
}

// The visible disks, in surfel order.
std::vector<Disk> prepare_all(const PosedSurfelsView& surfels, const Camera<double>& camera,
                              const raster::Options& options) {
  constexpr int64_t grain = 1024;
  std::vector<std::vector<Disk>> blocks(static_cast<size_t>((surfels.count + grain - 1) / grain));
  parallel_blocks("show: prepare ellipses", surfels.count, grain, [&](int64_t begin, int64_t end) {
    std::vector<Disk>& block = blocks[static_cast<size_t>(begin / grain)];
    for (int64_t i = begin; i < end; ++i) {
      if (const std::optional<Disk> disk = prepare(surfels, i, camera, options)) block.push_back(*disk);
    }
  });
  std::vector<Disk> disks;
  for (const std::vector<Disk>& block : blocks) disks.insert(disks.end(), block.begin(), block.end());
  return disks;
}

// For each tile the disks that may touch it, ascending.
struct TileLists {
  int across, down;
  std::vector<size_t> begin;  // start of each tile's list in `disk`, and the end
  std::vector<uint32_t> disk;

  TileLists(const std::vector<Disk>& disks, int width, int height)
      : across((width + tile_side - 1) / tile_side), down((height + tile_side - 1) / tile_side) {
    begin.assign(static_cast<size_t>(across) * static_cast<size_t>(down) + 1, 0);
    for (const Disk& d : disks)
      d.box.for_each_tile(across, [&](int tile) { ++begin[static_cast<size_t>(tile) + 1]; });
    for (size_t tile = 1; tile < begin.size(); ++tile) begin[tile] += begin[tile - 1];
    disk.resize(begin.back());
    std::vector<size_t> next(begin.begin(), begin.end() - 1);
    for (size_t i = 0; i < disks.size(); ++i) {
      disks[i].box.for_each_tile(
          across, [&](int tile) { disk[next[static_cast<size_t>(tile)]++] = static_cast<uint32_t>(i); });
    }
  }
};

class Drawing {
 public:
  Drawing(const std::vector<Disk>& disks, const Camera<double>& camera, const raster::Options& options)
      : disks_(disks), camera_(camera), lists_(disks, camera.width, camera.height) {
    largest_inverse_z_ = 1 / double{options.near_plane};
    background_ = clamp(options.background, 0.0F, 1.0F);
  }

  Tensor<float> draw() const {
    Tensor<float> picture(Shape{camera_.height, camera_.width, 3});
    parallel_for(
        "show: draw ellipses", int64_t{lists_.across} * lists_.down,
        [&](int64_t tile) { draw_tile(static_cast<int>(tile), picture); }, 1);
    return picture;
  }

 private:
  struct Nearest {
    double inverse_z = 0;
    const Disk* disk = nullptr;
  };
  using Pixels = std::array<Nearest, tile_side * tile_side>;

  void draw_tile(int tile, Tensor<float>& picture) const {
    const int left = tile % lists_.across * tile_side, top = tile / lists_.across * tile_side;
    const PixelBox box{left, top, std::min(left + tile_side, camera_.width) - 1,
                       std::min(top + tile_side, camera_.height) - 1};
    Pixels pixels;
    for (size_t k = lists_.begin[static_cast<size_t>(tile)]; k < lists_.begin[static_cast<size_t>(tile) + 1];
         ++k)
      meet(disks_[lists_.disk[k]], box, pixels);
    for (int y = box.top; y <= box.bottom; ++y) {
      for (int x = box.left; x <= box.right; ++x) {
        store3(&picture(y, x, 0), colour_of(pixels[at(box, x, y)], x + 0.5, y + 0.5));
      }
    }
  }

  static size_t at(const PixelBox& box, int x, int y) {
    const int place = (y - box.top) * tile_side + (x - box.left);
    return static_cast<size_t>(place);
  }

  void meet(const Disk& d, const PixelBox& box, Pixels& pixels) const {
    const int right = std::min(d.box.right, box.right), bottom = std::min(d.box.bottom, box.bottom);
    for (int y = std::max(d.box.top, box.top); y <= bottom; ++y) {
      for (int x = std::max(d.box.left, box.left); x <= right; ++x) {
        const double u = d.u.at(x + 0.5, y + 0.5), v = d.v.at(x + 0.5, y + 0.5), w = d.w.at(x + 0.5, y + 0.5);
        const double inverse_z = w * d.inverse_z_plane;
        Nearest& nearest = pixels[at(box, x, y)];
        if (u * u + v * v <= w * w && inverse_z > nearest.inverse_z && inverse_z <= largest_inverse_z_)
          nearest = {inverse_z, &d};
      }
    }
  }

  Vec3<float> colour_of(const Nearest& nearest, double x, double y) const {
    if (nearest.disk == nullptr) return background_;
    const Disk& d = *nearest.disk;
    const double u = d.u.at(x, y), v = d.v.at(x, y), w = d.w.at(x, y);
    return ellipse_colour(d.colour, w / length(camera_.ray_in_camera(x, y)), (u * u + v * v) / (w * w));
  }

  const std::vector<Disk>& disks_;
  const Camera<double>& camera_;
  TileLists lists_;
  double largest_inverse_z_;
  Vec3<float> background_;
};

}  // namespace

Vec3<float> ellipse_colour(const Vec3<float>& colour, double facing, double rho) {
  const double rim = std::clamp((rho - 0.6) / 0.4, 0.0, 1.0);
  const double light = (0.6 + 0.4 * facing) * (1 - 0.5 * rim * rim);
  return clamp(static_cast<float>(light) * colour, 0.0F, 1.0F);
}

Tensor<float> surfel_ellipses(const PosedSurfels& surfels, const Camera<float>& camera,
                              const raster::Options& options) {
  PosedSurfels fetched;
  if (surfels.device() != Device::cpu) fetched = surfels.on(Device::cpu);
  const PosedSurfelsView view = view_of(surfels.device() == Device::cpu ? surfels : fetched);
  const Camera<double> precise = convert<double>(camera);
  return Drawing(prepare_all(view, precise, options), precise, options).draw();
}

}  // namespace traceflow::viz
