#include "capture/lens/lens.h"

#include <cmath>
#include <limits>

#include "base/error.h"

namespace traceflow {

namespace {

constexpr double half_pi = 1.57079632679489661923;

// For a direction at r = tan θ: its ideal projected distance from the centre over r, and the derivative of
// that distance by r.
struct ProjectionFactor {
  double factor = 1, slope = 1;
};

// atan(t)/t.
double atan_over(double t) { return std::abs(t) < 1e-4 ? 1 - t * t / 3 : std::atan(t) / t; }

ProjectionFactor projection_factor(const Lens& lens, double r) {
  switch (lens.projection) {
    case Projection::perspective:
      return {};
    case Projection::equidistant:
      return {atan_over(r), 1 / (1 + r * r)};
    case Projection::fov: {
      const double wide = 2 * std::tan(lens.omega / 2), t = r * wide;
      return {wide / lens.omega * atan_over(t), wide / lens.omega / (1 + t * t)};
    }
  }
  return {};
}

// The inverse: r for a distance from the centre.
double direction_at(const Lens& lens, double distance) {
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  switch (lens.projection) {
    case Projection::perspective:
      return distance;
    case Projection::equidistant:
      return distance < half_pi ? std::tan(distance) : none;
    case Projection::fov: {
      const double angle = distance * lens.omega;
      return angle < half_pi ? std::tan(angle) / (2 * std::tan(lens.omega / 2)) : none;
    }
  }
  return none;
}

Vec2<double> project(const Lens& lens, const Vec2<double>& ideal) {
  return projection_factor(lens, length(ideal)).factor * ideal;
}

Vec2<double> unproject(const Lens& lens, const Vec2<double>& at) {
  const double distance = length(at);
  return distance > 0 ? direction_at(lens, distance) / distance * at : at;
}

// Along the radius the derivative is `slope`; across it, `factor`.
glm::dmat2 project_jacobian(const Lens& lens, const Vec2<double>& ideal) {
  const double r2 = dot(ideal, ideal);
  const ProjectionFactor at = projection_factor(lens, std::sqrt(r2));
  glm::dmat2 jacobian(at.factor);
  if (r2 > 0) jacobian += (at.slope - at.factor) / r2 * glm::outerProduct(ideal, ideal);
  return jacobian;
}

// k and its derivative by r².
struct Radial {
  double k, slope;
};

Radial radial_factor(const Lens& lens, double r2) {
  const Vec3<double>& a = lens.radial;
  const Vec3<double>& b = lens.radial_below;
  const double above = 1 + r2 * (a[0] + r2 * (a[1] + r2 * (a[2] + r2 * lens.radial_4)));
  const double above_slope = a[0] + r2 * (2 * a[1] + r2 * (3 * a[2] + r2 * 4 * lens.radial_4));
  const double below = 1 + r2 * (b[0] + r2 * (b[1] + r2 * b[2]));
  const double below_slope = b[0] + r2 * (2 * b[1] + r2 * 3 * b[2]);
  const double k = above / below;
  return {k, (above_slope - k * below_slope) / below};
}

// From (u, v) to (x', y').
Vec2<double> bend(const Lens& lens, const Vec2<double>& at) {
  const double u = at.x, v = at.y, r2 = u * u + v * v;
  const double k = radial_factor(lens, r2).k;
  const Vec2<double>& p = lens.tangential;
  const Vec4<double>& s = lens.prism;
  return {u * k + 2 * p[0] * u * v + p[1] * (r2 + 2 * u * u) + r2 * (s[0] + r2 * s[1]),
          v * k + 2 * p[1] * u * v + p[0] * (r2 + 2 * v * v) + r2 * (s[2] + r2 * s[3])};
}

glm::dmat2 bend_jacobian(const Lens& lens, const Vec2<double>& at) {
  const double u = at.x, v = at.y, r2 = u * u + v * v;
  const auto [k, slope] = radial_factor(lens, r2);
  const Vec2<double>& p = lens.tangential;
  const Vec4<double>& s = lens.prism;
  // Derivatives by r², whose own derivatives are 2u and 2v.
  const double x_prism = 2 * (s[0] + 2 * r2 * s[1]), y_prism = 2 * (s[2] + 2 * r2 * s[3]);
  const double both = 2 * u * v * slope + 2 * p[0] * u + 2 * p[1] * v;
  const double xx = k + 2 * u * u * slope + 2 * p[0] * v + 6 * p[1] * u + x_prism * u;
  const double yy = k + 2 * v * v * slope + 2 * p[1] * u + 6 * p[0] * v + y_prism * v;
  return {xx, both + y_prism * u, both + x_prism * v, yy};
}

// Whether f(ideal direction, stored pixel) holds on a regular grid over a pinhole's image, including its
// border.
template <class F>
bool everywhere(const Lens& lens, double zoom, bool border_only, F&& f) {
  constexpr int steps = 64;
  for (int j = 0; j <= steps; ++j) {
    for (int i = 0; i <= steps; ++i) {
      if (border_only && i != 0 && j != 0 && i != steps && j != steps) continue;
      const Vec2<double> pixel(0.5 + (lens.width - 1) * i / steps, 0.5 + (lens.height - 1) * j / steps);
      const Vec2<double> ideal = (pixel - lens.centre) / (zoom * lens.focal);
      if (!f(ideal, lens.pixel_from_ideal(ideal))) return false;
    }
  }
  return true;
}

bool fits(const Lens& lens, double zoom) {
  // Replicating half a pixel at the photograph's border is acceptable.
  return everywhere(lens, zoom, true, [&](const Vec2<double>&, const Vec2<double>& pixel) {
    return pixel.x >= 0 && pixel.y >= 0 && pixel.x <= lens.width && pixel.y <= lens.height;
  });
}

double least_zoom(const Lens& lens, const std::string& origin) {
  if (fits(lens, 1)) return 1;
  double low = 1, high = 2;
  if (!fits(lens, high)) {
    throw InputError(origin, "distortion", "a lens whose straightened image has no pixels",
                     "distortion that moves pixels by less than half the image");
  }
  for (int step = 0; step < 40; ++step) {
    const double middle = (low + high) / 2;
    (fits(lens, middle) ? high : low) = middle;
  }
  return high;
}

}  // namespace

bool Lens::is_pinhole() const {
  return projection == Projection::perspective && skew == 0 && radial == Vec3<double>(0) && radial_4 == 0 &&
         radial_below == Vec3<double>(0) && tangential == Vec2<double>(0) && prism == Vec4<double>(0);
}

Lens Lens::resized(double new_width, double new_height) const {
  const Vec2<double> ratio(new_width / width, new_height / height);
  Lens lens = *this;
  lens.width = new_width;
  lens.height = new_height;
  lens.focal *= ratio;
  lens.centre *= ratio;
  lens.skew *= ratio.x;
  return lens;
}

Vec2<double> Lens::distort(const Vec2<double>& ideal) const { return bend(*this, project(*this, ideal)); }

glm::dmat2 Lens::distort_jacobian(const Vec2<double>& ideal) const {
  return bend_jacobian(*this, project(*this, ideal)) * project_jacobian(*this, ideal);
}

Vec2<double> Lens::undistort(const Vec2<double>& distorted) const {
  Vec2<double> at = distorted;
  for (int step = 0; step < 20; ++step) {
    const glm::dmat2 jacobian = bend_jacobian(*this, at);
    if (std::abs(determinant(jacobian)) < 1e-12) break;
    const Vec2<double> correction = inverse(jacobian) * (bend(*this, at) - distorted);
    at -= correction;
    if (dot(correction, correction) < 1e-30) break;
  }
  return unproject(*this, at);
}

Vec2<double> Lens::pixel_from_ideal(const Vec2<double>& ideal) const {
  const Vec2<double> d = distort(ideal);
  return {focal.x * d.x + skew * d.y + centre.x, focal.y * d.y + centre.y};
}

Vec2<double> Lens::ideal_from_pixel(const Vec2<double>& pixel) const {
  const double y = (pixel.y - centre.y) / focal.y;
  return undistort({(pixel.x - centre.x - skew * y) / focal.x, y});
}

bool same_proportions(double width, double height, double other_width, double other_height) {
  return std::abs(width / other_width / (height / other_height) - 1) <= 0.02;
}

double pinhole_zoom(const Lens& lens, const std::string& origin) {
  const double zoom = least_zoom(lens, origin);
  const bool keeps_order = everywhere(lens, zoom, false, [&](const Vec2<double>& ideal, const Vec2<double>&) {
    const glm::dmat2 jacobian = lens.distort_jacobian(ideal);
    return determinant(jacobian) > 0 && jacobian[0][0] + jacobian[1][1] > 0;
  });
  if (!keeps_order) {
    throw InputError(origin, "distortion", "a lens that folds the image over",
                     "distortion that keeps the pixels' order", "calibrate with fewer coefficients");
  }
  const double widest = std::tan(80.0 / 90.0 * half_pi);
  const bool sensible = lens.projection == Projection::perspective ||
                        everywhere(lens, zoom, true, [&](const Vec2<double>& ideal, const Vec2<double>&) {
                          return length(ideal) < widest;
                        });
  if (!sensible) {
    throw InputError(origin, "focal length",
                     "a fisheye whose straightened corners see more than 80° off the axis",
                     "a view that a pinhole can have", "crop the images to their middle");
  }
  return zoom;
}

}  // namespace traceflow
