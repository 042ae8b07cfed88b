#include <algorithm>
#include <bit>
#include <cfloat>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "math/blend.h"
#include "math/rotation.h"
#include "math/spherical_harmonics.h"
#include "math/surfel_projection.h"
#include "ops/raster/raster_kernels.h"

// Surfels to splats (method §3.1), in double precision up to the last store. Bounds are conservative: what
// blending would have kept lies inside.
namespace traceflow::raster {
namespace {

// Added to every bound, in pixels, for what single precision moves.
constexpr double bounds_slack = 0.02;

struct Rectangle {
  double x0, y0, x1, y1;

  static Rectangle empty() {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    return {infinity, infinity, -infinity, -infinity};
  }
  void include(double x, double y) {
    x0 = std::min(x0, x);
    y0 = std::min(y0, y);
    x1 = std::max(x1, x);
    y1 = std::max(y1, y);
  }
};

// The disk within which a surfel blends, in camera axes: the points centre + a·half_u + b·half_v with a² + b²
// ≤ 1.
struct Disk {
  Vec3<double> centre, half_u, half_v;

  double nearest_z() const { return centre.z - std::hypot(half_u.z, half_v.z); }
};

// The projection of a disk that lies well in front of the camera is an ellipse; its bounding box is exact.
Rectangle ellipse_box(const Disk& disk, const Camera<double>& camera, const Vec2<double>& pixel,
                      Vec2<double>& ellipse_centre) {
  const Vec3<double>& c = disk.centre;
  // Screen offset from the projected centre = (a p_u + b p_v) / (c.z + a half_u.z + b half_v.z).
  const Vec2<double> offset(pixel.x - camera.centre_x, pixel.y - camera.centre_y);
  const Vec2<double> focal(camera.focal_x, camera.focal_y);
  const Vec2<double> p_u = focal * Vec2<double>(disk.half_u) - offset * disk.half_u.z;
  const Vec2<double> p_v = focal * Vec2<double>(disk.half_v) - offset * disk.half_v.z;
  const double d = c.z * c.z - disk.half_u.z * disk.half_u.z - disk.half_v.z * disk.half_v.z;
  const Vec2<double> shift = (disk.half_u.z * p_u + disk.half_v.z * p_v) * (-1 / d);
  const Vec2<double> half = sqrt(shift * shift + (p_u * p_u + p_v * p_v) * (1 / d));
  ellipse_centre = pixel + shift;
  return {ellipse_centre.x - half.x, ellipse_centre.y - half.y, ellipse_centre.x + half.x,
          ellipse_centre.y + half.y};
}

// The bounding box of the square around a disk, cut at the near plane. Empty when all of it lies behind.
Rectangle clipped_box(const Disk& disk, const Camera<double>& camera, double near_plane) {
  const Vec3<double> corners[4] = {
      disk.centre + disk.half_u + disk.half_v, disk.centre - disk.half_u + disk.half_v,
      disk.centre - disk.half_u - disk.half_v, disk.centre + disk.half_u - disk.half_v};
  Rectangle box = Rectangle::empty();
  const auto include = [&](const Vec3<double>& p) {
    const Vec2<double> pixel = camera.project(p);
    box.include(pixel.x, pixel.y);
  };
  for (int i = 0; i < 4; ++i) {
    const Vec3<double>& a = corners[i];
    const Vec3<double>& b = corners[(i + 1) % 4];
    if (a.z >= near_plane) include(a);
    if ((a.z >= near_plane) == (b.z >= near_plane)) continue;
    const Vec3<double> cut = a + (near_plane - a.z) / (b.z - a.z) * (b - a);
    include({cut.x, cut.y, near_plane});
  }
  return box;
}

// The tiles of the pixels whose centres lie in [low, high].
void tile_range(double low, double high, int pixels, int32_t& begin, int32_t& end) {
  const double first = std::ceil(std::max(low - bounds_slack - 0.5, 0.0));
  const double last = std::floor(std::min(high + bounds_slack - 0.5, pixels - 1.0));
  if (!(first <= last)) {
    begin = end = 0;
    return;
  }
  begin = static_cast<int32_t>(first) / tile_edge;
  end = static_cast<int32_t>(last) / tile_edge + 1;
}

bool all_finite(const float* values, int64_t count) {
  uint32_t bad = 0;
  for (int64_t i = 0; i < count; ++i) {
    bad |= static_cast<uint32_t>((std::bit_cast<uint32_t>(values[i]) & 0x7f800000U) == 0x7f800000U);
  }
  return bad == 0;
}

class Preparer {
 public:
  Preparer(const PosedSurfels& surfels, const Camera<float>& camera, const Options& options, Saved& saved)
      : surfels_(surfels),
        camera_(convert<double>(camera)),
        options_(options),
        saved_(saved),
        sh_degree_(surfels.count() > 0 ? sh_degree(surfels.sh.dim(1)) : 0) {}

  void run(int64_t i) {
    Bounds bounds;
    if (usable(i)) place(i, bounds);
    if (bounds.tiles() == 0) bounds = {};
    saved_.bounds[i] = bounds;
  }

 private:
  bool usable(int64_t i) const {
    const auto& s = surfels_;
    return s.opacity[i] >= options_.alpha_min && s.scale(i, 0) > 0 && s.scale(i, 1) > 0 &&
           all_finite(s.position.row(i), 3) && all_finite(s.scale.row(i), 2) &&
           all_finite(s.rotation.row(i), 4) && std::isfinite(s.opacity[i]) &&
           (!s.has_tint() || std::isfinite(s.tint[i]));
  }

  void place(int64_t i, Bounds& bounds) {
    const SurfelFrame<double> frame = surfel_frame(surfels_, i);
    const Vec3<double> from_camera = frame.position - camera_.position;
    const Vec3<double> centre = camera_.camera_from_world * from_camera;
    const bool in_front = centre.z >= options_.near_plane;
    if (!in_front && options_.sort == SortOrder::centre) return;
    const double opacity = surfels_.opacity[i];
    const double rho_max =
        std::max(cutoff_radius2(BlendRules<double>{options_.alpha_min, 0, 0}, opacity), 0.0);
    const Vec2<double> pixel = in_front ? camera_.project(centre) : Vec2<double>(0.0);
    const bool has_low_pass = options_.low_pass && in_front;

    const double radius = std::sqrt(rho_max);
    const Disk disk{centre, radius * frame.scale.x * (camera_.camera_from_world * frame.rotation[0]),
                    radius * frame.scale.y * (camera_.camera_from_world * frame.rotation[1])};
    bounds.is_ellipse = in_front && disk.nearest_z() > 0.1 * centre.z;
    Vec2<double> ellipse_centre(0.0);
    Rectangle box = bounds.is_ellipse ? ellipse_box(disk, camera_, pixel, ellipse_centre)
                                      : clipped_box(disk, camera_, options_.near_plane);
    if (has_low_pass) {
      const double reach = radius / std::sqrt(2.0);
      box.include(pixel.x - reach, pixel.y - reach);
      box.include(pixel.x + reach, pixel.y + reach);
    }
    tile_range(box.x0, box.x1, camera_.width, bounds.tile_x0, bounds.tile_x1);
    tile_range(box.y0, box.y1, camera_.height, bounds.tile_y0, bounds.tile_y1);
    if (bounds.tiles() == 0) return;

    Splat& splat = saved_.splats[i];
    const Vec2<double> anchor =
        in_front ? anchor_near(pixel) : anchor_near({camera_.width / 2.0, camera_.height / 2.0});
    store_forms(surfel_forms(frame, camera_), anchor, splat);
    splat.centre_x = static_cast<float>(has_low_pass ? pixel.x - anchor.x : 0);
    splat.centre_y = static_cast<float>(has_low_pass ? pixel.y - anchor.y : 0);
    splat.rho_screen_1 = has_low_pass ? 0 : 1e30F;
    splat.rho_max = static_cast<float>(rho_max);
    splat.log2_opacity = static_cast<float>(std::log2(opacity));
    splat.z_centre = static_cast<float>(centre.z);
    splat.inverse_z_centre = static_cast<float>(1 / centre.z);
    store_values(i, from_camera, frame.rotation[2], splat);
    if (!all_finite(&splat.anchor_x, sizeof(Splat) / sizeof(float))) bounds = {};
    if (bounds.is_ellipse) store_ellipse(splat, ellipse_centre - anchor, bounds);
  }

  // A whole pixel near the point, not far outside the image.
  Vec2<double> anchor_near(const Vec2<double>& pixel) const {
    return {std::floor(std::clamp(pixel.x, -64.0, camera_.width + 64.0)),
            std::floor(std::clamp(pixel.y, -64.0, camera_.height + 64.0))};
  }

  void store_forms(const SurfelForms<double>& forms, const Vec2<double>& anchor, Splat& splat) const {
    const Vec3<double> ray = camera_.ray_in_camera(anchor.x, anchor.y);
    const auto store = [&](const Vec3<double>& form, float& x, float& y, float& one) {
      x = static_cast<float>(form.x / camera_.focal_x);
      y = static_cast<float>(form.y / camera_.focal_y);
      one = static_cast<float>(dot(form, ray));
    };
    store(forms.u, splat.u_x, splat.u_y, splat.u_1);
    store(forms.v, splat.v_x, splat.v_y, splat.v_1);
    store(forms.w, splat.w_x, splat.w_y, splat.w_1);
    splat.anchor_x = static_cast<float>(anchor.x);
    splat.anchor_y = static_cast<float>(anchor.y);
    splat.z_plane = static_cast<float>(forms.z_plane);
    splat.inverse_z_plane =
        static_cast<float>(forms.z_plane > 0 ? std::min(1 / forms.z_plane, double{FLT_MAX}) : 0);
    splat.w_max = static_cast<float>(std::min(forms.z_plane / options_.near_plane, double{FLT_MAX}));
  }

  void store_values(int64_t i, const Vec3<double>& from_camera, const Vec3<double>& normal,
                    Splat& splat) const {
    const Vec3<float> direction(from_camera * (1 / length(from_camera)));
    const bool finite = all_finite(surfels_.sh.row(i), surfels_.sh.row_size());
    const auto colour = sh_colour<float>(sh_degree_, surfels_.sh.row(i), direction);
    store3(splat.colour, finite ? colour : Vec3<float>(std::numeric_limits<float>::quiet_NaN()));
    store3(splat.normal, normal * (dot(normal, from_camera) > 0 ? -1.0 : 1.0));
    splat.tint = surfels_.has_tint() ? surfels_.tint[i] : 0;
    std::fill(std::begin(splat.unused), std::end(splat.unused), 0.0F);
  }

  static void store_ellipse(const Splat& s, const Vec2<double>& centre, Bounds& bounds) {
    const double rho = s.rho_max;
    const auto product = [&](double ux, double uy, double vx, double vy, double wx, double wy) {
      return ux * uy + vx * vy - rho * wx * wy;
    };
    const double xx = product(s.u_x, s.u_x, s.v_x, s.v_x, s.w_x, s.w_x);
    const double xy = product(s.u_x, s.u_y, s.v_x, s.v_y, s.w_x, s.w_y);
    const double yy = product(s.u_y, s.u_y, s.v_y, s.v_y, s.w_y, s.w_y);
    bounds.ellipse_x = static_cast<float>(centre.x);
    bounds.ellipse_y = static_cast<float>(centre.y);
    bounds.slope_x = static_cast<float>(-xy / xx);
    bounds.slope_y = static_cast<float>(-xy / yy);
    bounds.is_ellipse = xx > 0 && yy > 0 && std::isfinite(bounds.slope_x) && std::isfinite(bounds.slope_y);
  }

  const PosedSurfels& surfels_;
  const Camera<double> camera_;
  const Options& options_;
  Saved& saved_;
  const int sh_degree_;
};

}  // namespace

SurfelFrame<double> surfel_frame(const PosedSurfels& surfels, int64_t i) {
  return {load3<double>(surfels.position.row(i)),
          rotation_from_quaternion(load4<double>(surfels.rotation.row(i))),
          {surfels.scale(i, 0), surfels.scale(i, 1)}};
}

void prepare(const PosedSurfels& surfels, const Camera<float>& camera, const Options& options, Saved& saved) {
  saved.count = surfels.count();
  saved.width = camera.width;
  saved.height = camera.height;
  saved.tile_columns = (camera.width + tile_edge - 1) / tile_edge;
  saved.tile_rows = (camera.height + tile_edge - 1) / tile_edge;
  saved.splats.resize({saved.count});
  saved.bounds.resize({saved.count});
  Preparer preparer(surfels, camera, options, saved);
  parallel_for(
      "raster: prepare", saved.count, [&](int64_t i) { preparer.run(i); }, 256);
}

}  // namespace traceflow::raster
