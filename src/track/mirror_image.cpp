#include "track/mirror_image.h"

namespace traceflow {

Vec3<double> turn_of_mirror_image(const BodySurface& surface, int32_t body, const Vec3<double>& eye,
                                  const Vec3<double>& shift) {
  constexpr double least_cosine = 0.3;  // between a surface and the ray to it
  constexpr int least_pixels = 10;
  const Vec3<double> first_eye(surface.camera.position);
  Mat3<double> a(0);
  Vec3<double> b(0);
  int pixels = 0;
  for (const SurfacePoint& point : surface.points) {
    if (point.body != body) continue;
    const Vec3<double> normal(point.normal), position(point.position);
    const Vec3<double> to_eye = normalize(first_eye - position);
    const double cosine = dot(normal, to_eye);
    if (cosine < least_cosine) continue;
    // The second view sees light from this direction where the normal is half way between it and the
    // direction to the eye.
    const Vec3<double> mirrored = 2 * cosine * normal - to_eye;
    const Vec3<double> then = normalize(mirrored + normalize(eye - position - shift));
    a += Mat3<double>(1) - outerProduct(normal, normal);
    b += cross(normal, then);
    ++pixels;
  }
  // A plane does not show rotations about its normal.
  constexpr double pull = 1e-3;  // per pixel, towards zero
  return pixels < least_pixels ? Vec3<double>(0) : inverse(a + Mat3<double>(pull * pixels)) * b;
}

}  // namespace traceflow
