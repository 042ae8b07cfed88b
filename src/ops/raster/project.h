#pragma once

#include <algorithm>
#include <bit>
#include <cfloat>
#include <cmath>
#include <limits>
#include <numbers>

#include "math/rotation.h"
#include "math/spherical_harmonics.h"
#include "math/surfel_projection.h"
#include "ops/raster/raster_kernels.h"
#include "scene/surfel_views.h"

// Projects surfels to splats (method §3.1). Computes in double precision up to the final store. Bounds are
// conservative: they contain everything that blending would keep.
namespace traceflow::raster {

// Added to every bound, in pixels, for rounding errors of single precision.
inline constexpr double bounds_slack = 0.02;

struct Rectangle {
  double x0, y0, x1, y1;

  TRACEFLOW_HD static Rectangle empty() {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    return {infinity, infinity, -infinity, -infinity};
  }
  TRACEFLOW_HD void include(double x, double y) {
    x0 = std::min(x0, x);
    y0 = std::min(y0, y);
    x1 = std::max(x1, x);
    y1 = std::max(y1, y);
  }
};

// The disk in which a surfel blends, in camera axes: points centre + a·half_u + b·half_v with a² + b² ≤ 1.
struct Disk {
  Vec3<double> centre, half_u, half_v;

  TRACEFLOW_HD double nearest_z() const {
    return centre.z - std::sqrt(half_u.z * half_u.z + half_v.z * half_v.z);
  }
};

// Returns the exact bounding box of the projected disk, which must lie well in front of the camera. Its
// projection is then an ellipse.
TRACEFLOW_HD inline Rectangle ellipse_box(const Disk& disk, const Camera<double>& camera,
                                          const Vec2<double>& pixel, Vec2<double>& ellipse_centre) {
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

// Returns the bounding box of the square around a disk, clipped at the near plane. Empty if the whole square
// is behind that plane.
TRACEFLOW_HD inline Rectangle clipped_box(const Disk& disk, const Camera<double>& camera, double near_plane) {
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

// The range of tiles that contain a pixel with its centre in [low, high].
TRACEFLOW_HD inline void tile_range(double low, double high, int pixels, int32_t& begin, int32_t& end) {
  const double first = std::ceil(std::max(low - bounds_slack - 0.5, 0.0));
  const double last = std::floor(std::min(high + bounds_slack - 0.5, pixels - 1.0));
  if (!(first <= last)) {
    begin = end = 0;
    return;
  }
  begin = static_cast<int32_t>(first) / tile_edge;
  end = static_cast<int32_t>(last) / tile_edge + 1;
}

// Projects one surfel to its splat and bounds, on either device.
class ProjectSurfel {
 public:
  // splats, bounds: N each.
  ProjectSurfel(const PosedSurfelsView& surfels, const Camera<float>& camera, const Options& options,
                Splat* splats, Bounds* bounds)
      : surfels_(surfels),
        camera_(convert<double>(camera)),
        near_plane_(options.near_plane),
        alpha_min_(options.alpha_min),
        log_alpha_min_(std::log(double{options.alpha_min})),
        by_centre_(options.sort == SortOrder::centre),
        low_pass_(options.low_pass),
        splats_(splats),
        bounds_(bounds) {
    find_sides();
  }

  TRACEFLOW_HD void operator()(int64_t i) const {
    Bounds bounds;
    if (usable(i)) place(i, bounds);
    if (bounds.tiles() == 0) bounds = {};
    bounds_[i] = bounds;
  }

 private:
  TRACEFLOW_HD bool usable(int64_t i) const {
    const auto& s = surfels_;
    return s.opacity[i] >= alpha_min_ && s.scale[2 * i] > 0 && s.scale[2 * i + 1] > 0 &&
           all_finite(s.position + 3 * i, 3) && all_finite(s.scale + 2 * i, 2) &&
           all_finite(s.rotation + 4 * i, 4) && std::isfinite(s.opacity[i]) &&
           (s.tint == nullptr || std::isfinite(s.tint[i])) &&
           (s.roughness == nullptr || std::isfinite(s.roughness[i]));
  }

  // A surfel's position and extent.
  struct Placement {
    Vec3<double> from_camera;  // world axes
    Vec3<double> centre;       // camera axes
    bool in_front;             // its centre is beyond the near plane
    bool has_low_pass;
    double log_opacity;
    double rho_max, radius;  // radius² = rho_max
    Vec2<double> pixel;      // the projected centre, if in_front
  };

  TRACEFLOW_HD void place(int64_t i, Bounds& bounds) const {
    Placement p{};
    p.from_camera = load3<double>(surfels_.position + 3 * i) - camera_.position;
    p.centre = camera_.camera_from_world * p.from_camera;
    p.in_front = p.centre.z >= near_plane_;
    if (!p.in_front && by_centre_) return;
    p.has_low_pass = low_pass_ > 0 && p.in_front;
    p.log_opacity = std::log(double{surfels_.opacity[i]});
    p.rho_max = std::max(2 * (p.log_opacity - log_alpha_min_), 0.0);
    p.radius = std::sqrt(p.rho_max);
    if (is_outside(p, std::max(surfels_.scale[2 * i], surfels_.scale[2 * i + 1]))) return;
    prefetch(surfels_.sh + surfels_.sh_row * i, surfels_.sh_row * int64_t{sizeof(float)});
    if (p.in_front) p.pixel = camera_.project(p.centre);

    const SurfelFrame<double> frame = surfel_frame(surfels_, i);
    const Mat3<double> axes = camera_.camera_from_world * frame.rotation;
    const Disk disk{p.centre, p.radius * frame.scale.x * axes[0], p.radius * frame.scale.y * axes[1]};
    const bool is_ellipse = p.in_front && disk.nearest_z() > 0.1 * p.centre.z;
    Vec2<double> ellipse_centre(std::numeric_limits<double>::quiet_NaN());
    Rectangle box = is_ellipse ? ellipse_box(disk, camera_, p.pixel, ellipse_centre)
                               : clipped_box(disk, camera_, near_plane_);
    if (p.has_low_pass) {
      const double filter_radius = p.radius * low_pass_ / std::sqrt(2.0);
      box.include(p.pixel.x - filter_radius, p.pixel.y - filter_radius);
      box.include(p.pixel.x + filter_radius, p.pixel.y + filter_radius);
    }
    tile_range(box.x0, box.x1, camera_.width, bounds.tile_x0, bounds.tile_x1);
    tile_range(box.y0, box.y1, camera_.height, bounds.tile_y0, bounds.tile_y1);
    if (bounds.tiles() == 0) return;
    if (!store(i, p, frame, ellipse_centre)) bounds = {};
  }

  // Returns true if the sphere around a surfel and its low-pass disk are beyond one side of the image. The
  // test is fast but does not find all such surfels.
  TRACEFLOW_HD bool is_outside(const Placement& p, double scale) const {
    const double ball = p.radius * scale;
    const double disk = p.in_front ? (p.radius * std::max(low_pass_, 1.0) + 1) * p.centre.z : 0;
    for (const Side& side : sides_) {
      if (dot(side.plane, p.centre) + std::max(ball * side.norm, disk) < 0) return true;
    }
    return false;
  }

  // Returns false if single precision cannot represent the splat.
  TRACEFLOW_HD bool store(int64_t i, const Placement& p, const SurfelFrame<double>& frame,
                          const Vec2<double>& ellipse_centre) const {
    Splat& splat = splats_[i];
    const Vec2<double> anchor =
        anchor_near(p.in_front ? p.pixel : Vec2<double>(camera_.width / 2.0, camera_.height / 2.0));
    store_forms(surfel_forms(frame, camera_), anchor, splat);
    splat.centre_x = p.has_low_pass ? static_cast<float>(p.pixel.x - anchor.x) : Splat::far_away;
    splat.centre_y = p.has_low_pass ? static_cast<float>(p.pixel.y - anchor.y) : Splat::far_away;
    splat.rho_max = static_cast<float>(p.rho_max);
    splat.log2_opacity = static_cast<float>(p.log_opacity / std::numbers::ln2);
    splat.z_centre = static_cast<float>(p.centre.z);
    splat.inverse_z_centre = static_cast<float>(1 / p.centre.z);
    store_values(i, p.from_camera, frame.rotation[2], splat);
    splat.ellipse_x = splat.ellipse_y = splat.slope_x = splat.slope_y = 0;
    if (!all_finite(&splat.anchor_x, sizeof(Splat) / sizeof(float))) return false;
    store_ellipse(ellipse_centre - anchor, splat);
    return true;
  }

  // A whole pixel near the point, at most 64 pixels outside the image.
  TRACEFLOW_HD Vec2<double> anchor_near(const Vec2<double>& pixel) const {
    return {std::floor(std::clamp(pixel.x, -64.0, camera_.width + 64.0)),
            std::floor(std::clamp(pixel.y, -64.0, camera_.height + 64.0))};
  }

  TRACEFLOW_HD void store_forms(const SurfelForms<double>& forms, const Vec2<double>& anchor,
                                Splat& splat) const {
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
    splat.w_max = static_cast<float>(std::min(forms.z_plane / near_plane_, double{FLT_MAX}));
  }

  TRACEFLOW_HD void store_values(int64_t i, const Vec3<double>& from_camera, const Vec3<double>& normal,
                                 Splat& splat) const {
    const Vec3<float> direction(from_camera * (1 / length(from_camera)));
    const bool finite = all_finite(surfels_.sh + surfels_.sh_row * i, surfels_.sh_row);
    const auto colour = sh_colour<float>(surfels_.sh_degree, surfels_.sh + surfels_.sh_row * i, direction);
    store3(splat.colour, finite ? colour : Vec3<float>(std::numeric_limits<float>::quiet_NaN()));
    store3(splat.normal, normal * (dot(normal, from_camera) > 0 ? -1.0 : 1.0));
    splat.tint = surfels_.tint != nullptr ? surfels_.tint[i] : 0;
    const float in_body = surfels_.in_body != nullptr ? surfels_.in_body[i] : 0;
    const float roughness = surfels_.roughness != nullptr ? surfels_.roughness[i] : 0;
    // The product keeps a value that is not finite.
    splat.signed_roughness = std::copysign(roughness + 0 * in_body, in_body != 0 ? -1.0F : 1.0F);
  }

  TRACEFLOW_HD static void store_ellipse(const Vec2<double>& centre, Splat& s) {
    const double rho = s.rho_max;
    const double xx = double{s.u_x} * s.u_x + double{s.v_x} * s.v_x - rho * s.w_x * s.w_x;
    const double xy = double{s.u_x} * s.u_y + double{s.v_x} * s.v_y - rho * s.w_x * s.w_y;
    const double yy = double{s.u_y} * s.u_y + double{s.v_y} * s.v_y - rho * s.w_y * s.w_y;
    s.ellipse_x = static_cast<float>(centre.x);
    s.ellipse_y = static_cast<float>(centre.y);
    s.slope_x = static_cast<float>(-xy / xx);
    s.slope_y = static_cast<float>(-xy / yy);
    const bool is_sound = xx > 0 && yy > 0 && all_finite(&s.ellipse_x, 4);
    if (!is_sound) s.ellipse_x = std::numeric_limits<float>::quiet_NaN();
  }

  // A side of the image as a plane through the camera: visible points have plane · point ≥ 0.
  struct Side {
    Vec3<double> plane;
    double norm;
  };
  void find_sides() {
    const auto side = [](double x, double y, double z) {
      return Side{{x, y, z}, std::sqrt(x * x + y * y + z * z)};
    };
    const Camera<double>& c = camera_;
    sides_[0] = side(c.focal_x, 0, c.centre_x);
    sides_[1] = side(-c.focal_x, 0, c.width - c.centre_x);
    sides_[2] = side(0, c.focal_y, c.centre_y);
    sides_[3] = side(0, -c.focal_y, c.height - c.centre_y);
  }

  PosedSurfelsView surfels_;
  Camera<double> camera_;
  double near_plane_;
  float alpha_min_;
  double log_alpha_min_;
  int64_t by_centre_;  // a bool; 64 bits avoid padding, which could hold a stale address
  double low_pass_;
  Splat* splats_;
  Bounds* bounds_;
  Side sides_[4];
};

}  // namespace traceflow::raster
