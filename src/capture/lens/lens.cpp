#include "capture/lens/lens.h"

#include <cmath>

#include "base/error.h"

namespace traceflow {

namespace {

// Derivative of distort: glm columns are d/dx and d/dy.
glm::dmat2 distortion_jacobian(const Lens& lens, const Vec2<double>& ideal) {
  const double x = ideal.x, y = ideal.y, r2 = x * x + y * y;
  const double k = 1 + r2 * (lens.radial[0] + r2 * (lens.radial[1] + r2 * lens.radial[2]));
  const double dk = lens.radial[0] + r2 * (2 * lens.radial[1] + r2 * 3 * lens.radial[2]);  // dk/dr²
  const double p1 = lens.tangential[0], p2 = lens.tangential[1];
  const double xx = k + 2 * x * x * dk + 2 * p1 * y + 6 * p2 * x;
  const double yy = k + 2 * y * y * dk + 2 * p2 * x + 6 * p1 * y;
  const double xy = 2 * x * y * dk + 2 * p1 * x + 2 * p2 * y;
  return {xx, xy, xy, yy};
}

// f(ideal direction, stored pixel) at places spread over a pinhole's image, its border included, until it is
// false.
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

}  // namespace

bool Lens::is_pinhole() const {
  return skew == 0 && radial == Vec3<double>(0) && tangential == Vec2<double>(0);
}

Lens Lens::resized(double new_width, double new_height) const {
  const Vec2<double> ratio(new_width / width, new_height / height);
  return {new_width, new_height, focal * ratio, centre * ratio, skew * ratio.x, radial, tangential};
}

Vec2<double> Lens::distort(const Vec2<double>& ideal) const {
  const double x = ideal.x, y = ideal.y, r2 = x * x + y * y;
  const double k = 1 + r2 * (radial[0] + r2 * (radial[1] + r2 * radial[2]));
  return {x * k + 2 * tangential[0] * x * y + tangential[1] * (r2 + 2 * x * x),
          y * k + 2 * tangential[1] * x * y + tangential[0] * (r2 + 2 * y * y)};
}

Vec2<double> Lens::undistort(const Vec2<double>& distorted) const {
  Vec2<double> ideal = distorted;
  for (int step = 0; step < 20; ++step) {
    const glm::dmat2 jacobian = distortion_jacobian(*this, ideal);
    if (std::abs(determinant(jacobian)) < 1e-12) break;
    const Vec2<double> correction = inverse(jacobian) * (distort(ideal) - distorted);
    ideal -= correction;
    if (dot(correction, correction) < 1e-30) break;
  }
  return ideal;
}

Vec2<double> Lens::pixel_from_ideal(const Vec2<double>& ideal) const {
  const Vec2<double> d = distort(ideal);
  return {focal.x * d.x + skew * d.y + centre.x, focal.y * d.y + centre.y};
}

Vec2<double> Lens::ideal_from_pixel(const Vec2<double>& pixel) const {
  const double y = (pixel.y - centre.y) / focal.y;
  return undistort({(pixel.x - centre.x - skew * y) / focal.x, y});
}

double pinhole_zoom(const Lens& lens, const std::string& origin) {
  constexpr double largest = 2;
  // Half a pixel of the photograph's border may be replicated.
  const auto fits = [&](double zoom) {
    return everywhere(lens, zoom, true, [&](const Vec2<double>&, const Vec2<double>& pixel) {
      return pixel.x >= 0 && pixel.y >= 0 && pixel.x <= lens.width && pixel.y <= lens.height;
    });
  };
  double zoom = 1;
  if (!fits(1)) {
    double low = 1, high = largest;
    if (!fits(high)) {
      throw InputError(origin, "radial_distortion", "a lens whose straightened image has no pixels",
                       "distortion that moves pixels by less than half the image");
    }
    for (int step = 0; step < 40; ++step) {
      const double middle = (low + high) / 2;
      (fits(middle) ? high : low) = middle;
    }
    zoom = high;
  }
  const bool keeps_order = everywhere(lens, zoom, false, [&](const Vec2<double>& ideal, const Vec2<double>&) {
    const glm::dmat2 jacobian = distortion_jacobian(lens, ideal);
    return determinant(jacobian) > 0 && jacobian[0][0] + jacobian[1][1] > 0;
  });
  if (!keeps_order) {
    throw InputError(origin, "radial_distortion", "a lens that folds the image over",
                     "distortion that keeps the pixels' order", "calibrate with fewer coefficients");
  }
  return zoom;
}

}  // namespace traceflow
