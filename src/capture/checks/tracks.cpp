#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "capture/checks/checks.h"

namespace traceflow {

namespace {

// Distance in the image, in pixels or as a share of its width, whichever is more: trackers are less exact in
// large images.
constexpr double near_pixels = 2;
constexpr double near_width = 0.004;
constexpr int64_t gap_parts = 4;        // two compared views are this part of all views apart
constexpr int64_t fewest_pairs = 100;   // compared places off the masks
constexpr double least_agreeing = 0.5;  // of the places off the masks

// A view whose tracks are compared.
struct TrackedView {
  const ViewFacts* facts = nullptr;
  int64_t row = 0;  // in capture.tracks
};

// The distance in pixels of b's view from the image of a's ray through `from` to what `to` says. The image of
// the ray begins where its far end appears, so a point cannot agree from behind a camera. Directions are X/Z
// and Y/Z.
double distance_from_ray(const Camera<float>& a, const Vec2<double>& from, const Camera<float>& b,
                         const Vec2<double>& to) {
  const Mat3<double> b_from_world(b.camera_from_world);
  const Vec3<double> far = b_from_world * (Vec3<double>(from, 1.0) * Mat3<double>(a.camera_from_world));
  const Vec3<double> origin = b_from_world * Vec3<double>(a.position - b.position);
  const Vec2<double> focal(b.focal_x, b.focal_y);
  const Vec2<double> pixel = focal * to;
  // In pixels from the principal point: far + s · origin, s = 1 / depth in a.
  const Vec3<double> begin(focal * Vec2<double>(far), far.z), step(focal * Vec2<double>(origin), origin.z);
  double distance = far.z > 0 ? length(Vec2<double>(begin) / begin.z - pixel) : INFINITY;
  const Vec3<double> line = cross(begin, step);
  const double size = length(Vec2<double>(line));
  if (!(size > 0)) return distance;
  const double offset = dot(line, Vec3<double>(pixel, 1.0)) / size;
  const Vec2<double> foot = pixel - Vec2<double>(line) * (offset / size);
  const Vec2<double> still = Vec2<double>(begin) - foot * begin.z,
                     moving = Vec2<double>(step) - foot * step.z;
  const double along = -dot(still, moving) / dot(moving, moving);
  if (along >= 0 && begin.z + along * step.z > 0) distance = std::min(distance, std::abs(offset));
  return distance;
}

bool agrees(const Capture& capture, const TrackedView& a, const TrackedView& b, int64_t point) {
  const auto direction = [&](const TrackedView& view) {
    return Vec2<double>(capture.tracks.direction(view.row, point, 0),
                        capture.tracks.direction(view.row, point, 1));
  };
  const auto is_near = [&](const TrackedView& from, const TrackedView& to) {
    const Camera<float>& camera = to.facts->view->camera;
    const double limit = std::max(near_pixels, near_width * camera.width);
    return distance_from_ray(from.facts->view->camera, direction(from), camera, direction(to)) <= limit;
  };
  return is_near(a, b) && is_near(b, a);
}

std::vector<TrackedView> tracked_views(const Capture& capture, const std::vector<ViewFacts>& facts) {
  std::vector<TrackedView> views;
  for (const ViewFacts& view : facts) {
    const auto place =
        std::ranges::find_if(capture.train, [&](const View& other) { return &other == view.view; });
    if (place != capture.train.end() && view.broken.empty())
      views.push_back({&view, std::distance(capture.train.begin(), place)});
  }
  return views;
}

}  // namespace

Inspection::Tracks check_tracks(const Capture& capture, const std::vector<ViewFacts>& facts,
                                Findings& findings) {
  Inspection::Tracks result;
  const PointTracks& tracks = capture.tracks;
  if (tracks.empty()) return result;
  result.points = tracks.count();
  result.views = static_cast<double>(std::ranges::count(tracks.seen.values(), 1)) /
                 static_cast<double>(std::max<int64_t>(1, result.points));

  const std::vector<TrackedView> views = tracked_views(capture, facts);
  const auto gap = std::max<size_t>(1, views.size() / gap_parts);
  int64_t on_masks = 0, off_masks = 0, agreeing = 0;
  for (size_t i = 0; i + gap < views.size(); ++i) {
    const TrackedView &a = views[i], &b = views[i + gap];
    for (int64_t n = 0; n < result.points; ++n) {
      if (tracks.seen(a.row, n) == 0 || tracks.seen(b.row, n) == 0) continue;
      const auto is_on_mask = [&](const TrackedView& view) {
        return !view.facts->track_on_mask.empty() && view.facts->track_on_mask[static_cast<size_t>(n)] != 0;
      };
      if (is_on_mask(a) || is_on_mask(b)) {
        ++on_masks;
      } else {
        ++off_masks;
        agreeing += agrees(capture, a, b, n) ? 1 : 0;
      }
    }
  }
  result.compared = off_masks;
  if (off_masks + on_masks > 0) {
    result.consistent = static_cast<double>(on_masks + agreeing) / static_cast<double>(on_masks + off_masks);
  }
  if (off_masks < fewest_pairs) return result;
  const double share = static_cast<double>(agreeing) / static_cast<double>(off_masks);
  result.agreeing = share;
  if (share >= least_agreeing) return result;
  // Without masks the tracks may all be on a thing that moves.
  Finding& finding = findings.emplace_back(
      fmt::format("only {:.0f}% of the tracks{} agree with the cameras: {}are they in another order, or of "
                  "pictures of another width or frame rate?",
                  100 * share, capture.has_masks ? " off the masks" : "",
                  capture.has_masks ? "" : "do they lie on what moves, without masks that show it, or "),
      "tracks-disagree", capture.has_masks ? Severity::problem : Severity::notice);
  finding.value = share;
  finding.threshold = least_agreeing;
  return result;
}

}  // namespace traceflow
