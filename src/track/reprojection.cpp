#include "track/reprojection.h"

#include <array>
#include <cmath>

namespace traceflow {

namespace {

// In pixels. Much larger errors hardly count, because the point tracker has lost the point.
constexpr double lost = 1;
// Between the surface and the ray to it: tracks slip off near a body's edge.
constexpr float least_cosine_of_track = 0.3F;

}  // namespace

std::vector<TrackedPoint> tracked_points(const PointTracks& tracks, int64_t from_view, int64_t to_view,
                                         const BodySurface& surface, const Motion& motion, int64_t from_key,
                                         const Camera<float>& to) {
  std::vector<TrackedPoint> points;
  const Camera<float>& from = surface.camera;
  for (int64_t n = 0; n < tracks.count(); ++n) {
    if (tracks.seen(from_view, n) == 0 || tracks.seen(to_view, n) == 0) continue;
    const Vec2<float> pixel =
        from.project({tracks.direction(from_view, n, 0), tracks.direction(from_view, n, 1), 1.0F});
    const auto column = static_cast<int64_t>(std::floor(pixel.x)),
               row = static_cast<int64_t>(std::floor(pixel.y));
    if (column < 0 || row < 0 || column >= from.width || row >= from.height) continue;
    SurfacePoint point = surface.points[static_cast<size_t>(row * from.width + column)];
    if (point.body < 0) continue;
    const Vec3<float> ray = from.ray_in_world(pixel.x, pixel.y);
    if (!(-dot(point.normal, ray) > least_cosine_of_track * length(ray))) continue;
    point.position =
        from.position + dot(point.normal, point.position - from.position) / dot(point.normal, ray) * ray;
    points.push_back({at_rest(point, motion, from_key),
                      to.project({tracks.direction(to_view, n, 0), tracks.direction(to_view, n, 1), 1.0F})});
  }
  return points;
}

double reproject(const Reprojection& reprojection, const Motion& motion, int64_t key,
                 const std::vector<TrackedPart>& parts, NormalEquations* equations) {
  const Camera<double> camera = convert<double>(reprojection.camera);
  const std::vector<Mat3<double>> rotation = rotations_at(motion, key);
  double cost = 0;
  for (const TrackedPoint& point : reprojection.points) {
    const auto body = static_cast<size_t>(point.rest.body);
    const TrackedPart& part = parts[body];
    if (!part.shifts && part.turns == Mat3<double>(0)) continue;
    const Vec3<double> centre = load3<double>(motion.centre.row(point.rest.body));
    const Vec3<double> arm = rotation[body] * (Vec3<double>(point.rest.position) - centre);
    const Vec3<double> in_camera =
        camera.point_in_camera(centre + arm + load3<double>(&motion.shift(point.rest.body, key, 0)));
    const Vec2<double> error =
        in_camera.z > 0 ? camera.project(in_camera) - Vec2<double>(point.seen) : Vec2<double>(HUGE_VAL);
    const double size = dot(error, error), share = 1 / (1 + size / (lost * lost));
    cost += reprojection.weight * lost * lost / 2 * (1 - share);
    if (equations == nullptr || !(in_camera.z > 0)) continue;
    const std::array<Vec3<double>, 2> by_point = pixel_by_point(camera, in_camera);
    for (int side = 0; side < 2; ++side) {
      const Vec3<double>& shift = by_point[static_cast<size_t>(side)];
      const Vec3<double> turn = part.turns * cross(arm, shift);
      const double s = part.shifts ? 1 : 0;
      equations->add<6>(6 * body, {turn.x, turn.y, turn.z, s * shift.x, s * shift.y, s * shift.z},
                        error[side], reprojection.weight * share * share);
    }
  }
  return cost;
}

}  // namespace traceflow
