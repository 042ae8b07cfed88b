#include "track/redetection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "math/rotation_group.h"
#include "track/body_surface.h"
#include "track/mask_parts.h"

namespace traceflow {

namespace {

// A body is lost if less than this share of its visible pixels is inside the mask.
constexpr double least_inside = 0.3;
// Parts of the mask smaller than this share of the body's previous area are ignored.
constexpr double least_part = 0.2;
constexpr double fewest_free_pixels = 12;
// Radians, of the rotations that are tried.
constexpr std::array<double, 2> turned_by = {0.4, 0.9};
constexpr double wide_blur = 4;  // pixels

// The largest part of the mask without other bodies than the lost one.
struct FreePart {
  double area = 0;           // pixels
  Vec2<double> centroid{0};  // pixels
  bool at_border = false;
};

FreePart free_part(const TrackTarget& target, const BodySurface& surface, int64_t sought) {
  Tensor<uint8_t> is_free = target.mask;
  for (int64_t at = 0; at < is_free.size(); ++at) {
    const int32_t covers = surface.points[static_cast<size_t>(at)].body;
    if (covers >= 0 && covers != sought) is_free[at] = 0;
  }
  const std::vector<std::vector<int64_t>> parts = mask_parts(is_free);
  if (parts.empty()) return {};
  const std::vector<int64_t>& largest = *std::max_element(
      parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.size() < b.size(); });
  const int64_t height = is_free.dim(0), width = is_free.dim(1);
  FreePart part{static_cast<double>(largest.size())};
  for (const int64_t pixel : largest) {
    const int64_t row = pixel / width, column = pixel % width;
    part.centroid +=
        Vec2<double>(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5) / part.area;
    part.at_border = part.at_border || row == 0 || column == 0 || row + 1 == height || column + 1 == width;
  }
  return part;
}

// For each body, the number of its visible pixels, and of those inside the mask.
struct Shown {
  std::vector<int64_t> all, inside;
};

Shown shown_in(const BodySurface& surface, const Tensor<uint8_t>& mask, int64_t bodies) {
  Shown shown{std::vector<int64_t>(static_cast<size_t>(bodies)),
              std::vector<int64_t>(static_cast<size_t>(bodies))};
  for (int64_t at = 0; at < mask.size(); ++at) {
    const int32_t body = surface.points[static_cast<size_t>(at)].body;
    if (body < 0) continue;
    ++shown.all[static_cast<size_t>(body)];
    if (mask[at] != 0) ++shown.inside[static_cast<size_t>(body)];
  }
  return shown;
}

void put(Motion& motion, int64_t body, int64_t key, const Vec3<double>& shift, const Vec4<double>& rotation) {
  for (int c = 0; c < 4; ++c) motion.rotation(body, key, c) = static_cast<float>(rotation[c]);
  store3(&motion.shift(body, key, 0), shift);
}

// The new translation of a lost body; empty if no free part of the mask is large enough.
std::optional<Vec3<double>> place_in(const FreePart& part, const PoseSolver& solver, const Surfels& main,
                                     const Motion& motion, int64_t body, int64_t previous) {
  const TrackTarget& target = solver.targets().front();
  const Camera<float>& camera = target.camera;
  const BodySurface then = draw_bodies(camera, motion, previous, main, solver.drawing());
  const Shown shown = shown_in(then, target.mask, motion.bodies());
  const auto area = static_cast<double>(shown.all[static_cast<size_t>(body)]);
  if (part.area < std::max(fewest_free_pixels, least_part * area)) return std::nullopt;
  const Vec3<double> centre = load3<double>(motion.centre.row(body));
  const Vec3<double> last = centre + load3<double>(&motion.shift(body, previous, 0));
  double depth = camera.point_in_camera(Vec3<float>(last)).z;
  if (!(depth > 0)) return std::nullopt;
  if (!part.at_border && area > 0) depth *= std::sqrt(area / part.area);
  const Vec3<double> ray(
      camera.ray_in_world(static_cast<float>(part.centroid.x), static_cast<float>(part.centroid.y)));
  return Vec3<double>(camera.position) + depth * ray - centre;
}

// Solves a body from several rotations. Keeps the best if it costs less than the current pose.
bool try_turns(PoseSolver& solver, Motion& motion, int64_t body, int64_t key, const Vec3<double>& shift,
               const TrackWeights& weights, const PoseSteps& steps) {
  double least = solver.cost(weights);
  std::vector<Vec3<double>> turns{Vec3<double>(0)};
  for (const double by : turned_by) {
    for (int axis = 0; axis < 3; ++axis) {
      Vec3<double> turn(0);
      turn[axis] = by;
      turns.insert(turns.end(), {turn, -turn});
    }
  }
  const Vec4<double> rotation = unit_quaternion(load4<double>(&motion.rotation(body, key - 1, 0)));
  const Tensor<float> rotations = motion.rotation, shifts = motion.shift;
  Tensor<float> best_rotations = rotations, best_shifts = shifts;
  bool is_better = false;
  for (const Vec3<double>& turn : turns) {
    motion.rotation = rotations;
    motion.shift = shifts;
    put(motion, body, key, shift, quaternion_product(quaternion_exp(turn), rotation));
    solver.refresh();
    solver.solve(weights, {steps.count, wide_blur});
    const double cost = solver.cost(weights);
    if (!(cost < least)) continue;
    least = cost;
    best_rotations = motion.rotation;
    best_shifts = motion.shift;
    is_better = true;
  }
  motion.rotation = best_rotations;
  motion.shift = best_shifts;
  solver.refresh();
  if (is_better) solver.solve(weights, steps);
  return is_better;
}

}  // namespace

int find_lost_bodies(PoseSolver& solver, const Surfels& main, Motion& motion, int64_t key,
                     const TrackWeights& weights, const PoseSteps& steps) {
  if (solver.targets().empty()) return 0;
  const TrackTarget& target = solver.targets().front();
  int found = 0;
  for (int64_t body = 0; body < motion.bodies(); ++body) {
    const BodySurface surface = draw_bodies(target.camera, motion, key, main, solver.drawing());
    const Shown now = shown_in(surface, target.mask, motion.bodies());
    const auto b = static_cast<size_t>(body);
    if (static_cast<double>(now.inside[b]) > least_inside * static_cast<double>(now.all[b])) continue;
    const std::optional<Vec3<double>> shift =
        place_in(free_part(target, surface, body), solver, main, motion, body, key - 1);
    if (shift && try_turns(solver, motion, body, key, *shift, weights, steps)) ++found;
  }
  return found;
}

}  // namespace traceflow
