#include "viz/track_picture.h"

#include <algorithm>
#include <cmath>

namespace traceflow::viz {

namespace {

// Tolerance on the median depth, as a fraction of it, since surfels scatter about the surface.
constexpr double behind = 0.02;

// Pixels, for an image whose shorter side has 360 pixels; and the minimum.
constexpr double usual_side = 360, line_width = 1.3, dot_radius = 2;
constexpr double least_line_width = 1, least_dot_radius = 1.2;

// The fraction of a pixel at this distance that a line of this half width covers.
double coverage(double distance, double half_width) {
  return std::clamp(half_width + 0.5 - distance, 0.0, 1.0);
}

// Blends one track after another over a picture. Where a track crosses itself, the stronger part counts, so
// that joints and loops are not visible.
class Pen {
 public:
  explicit Pen(Tensor<float>& picture)
      : picture_(picture),
        width_(picture.dim(1)),
        height_(picture.dim(0)),
        ink_(static_cast<size_t>(width_ * height_), 0.0F) {
    const double size = static_cast<double>(std::min(width_, height_)) / usual_side;
    half_line_ = std::max(least_line_width, line_width * size) / 2;
    dot_ = std::max(least_dot_radius, dot_radius * size);
  }

  void line(const SeenTrack& track, float oldest) {
    const auto strength = [&](size_t k) { return std::clamp(1.0 - track.age[k] / oldest, 0.0, 1.0); };
    for (size_t k = 0; k + 1 < track.place.size(); ++k)
      segment(track.place[k], track.place[k + 1], half_line_, strength(k), strength(k + 1));
    dry(track.colour);
  }
  void dot(const SeenTrack& track) {
    segment(track.place[0], track.place[0], dot_, 1, 1);
    dry(track.colour);
  }

 private:
  // The pixels whose centres are between two coordinates.
  struct Range {
    int64_t first, last;
  };
  static Range range(double low, double high, int64_t end) {
    const auto limit = static_cast<double>(end);
    return {static_cast<int64_t>(std::ceil(std::clamp(low - 0.5, 0.0, limit))),
            static_cast<int64_t>(std::floor(std::clamp(high - 0.5, -1.0, limit - 1)))};
  }

  // Strengths are given for the segment's ends.
  void segment(const Vec2<double>& a, const Vec2<double>& b, double half, double from, double to) {
    const Vec2<double> way = b - a;
    const double squared = dot_of(way, way), radius = half + 0.5;
    const Range rows = range(std::min(a.y, b.y) - radius, std::max(a.y, b.y) + radius, height_);
    for (int64_t y = rows.first; y <= rows.last; ++y) {
      // The x range of the part of the segment that can touch this row.
      const double middle = static_cast<double>(y) + 0.5;
      const auto x_at = [&](double row) {
        return a.x + std::clamp(way.y == 0 ? 0.0 : (row - a.y) / way.y, 0.0, 1.0) * way.x;
      };
      double left = std::min(a.x, b.x), right = std::max(a.x, b.x);
      if (way.y != 0) {
        left = std::min(x_at(middle - radius), x_at(middle + radius));
        right = std::max(x_at(middle - radius), x_at(middle + radius));
      }
      const Range columns = range(left - radius, right + radius, width_);
      for (int64_t x = columns.first; x <= columns.last; ++x) {
        const Vec2<double> pixel(static_cast<double>(x) + 0.5, middle);
        const double t = squared > 0 ? std::clamp(dot_of(pixel - a, way) / squared, 0.0, 1.0) : 0;
        wet(y * width_ + x, coverage(length(pixel - (a + t * way)), half) * std::lerp(from, to, t));
      }
    }
  }
  static double dot_of(const Vec2<double>& a, const Vec2<double>& b) { return a.x * b.x + a.y * b.y; }

  void wet(int64_t pixel, double strength) {
    float& ink = ink_[static_cast<size_t>(pixel)];
    if (!(strength > ink)) return;
    if (ink == 0) wet_.push_back(pixel);
    ink = static_cast<float>(strength);
  }
  void dry(const Vec3<float>& colour) {
    for (const int64_t pixel : wet_) {
      float& ink = ink_[static_cast<size_t>(pixel)];
      float* const to = picture_.data() + 3 * pixel;
      store3(to, mix(load3<float>(to), colour, ink));
      ink = 0;
    }
    wet_.clear();
  }

  Tensor<float>& picture_;
  int64_t width_, height_;
  double half_line_, dot_;
  std::vector<float> ink_;  // of the present track, H×W
  std::vector<int64_t> wet_;
};

}  // namespace

Vec3<float> rainbow_colour(float hue) {
  // Five sixths of the hue circle, so that the two ends differ.
  const float angle = 5 * std::clamp(hue, 0.0F, 1.0F);
  const auto channel = [&](float from) {
    const float away = std::fmod(angle + from, 6.0F);
    return std::clamp(std::abs(away - 3) - 1, 0.0F, 1.0F);
  };
  return {channel(0), channel(4), channel(2)};
}

PointViewer::PointViewer(const Frame& frame)
    : camera_(convert<double>(frame.camera)),
      near_plane_(frame.drawn_with.near_plane),
      depth_(on_host(frame.raster.median_depth, fetched_)) {}

SeenPoint PointViewer::see(const Vec3<double>& point) const {
  SeenPoint seen;
  const Vec3<double> in_camera = camera_.point_in_camera(point);
  const Vec2<double> place = camera_.project(in_camera);
  if (!(in_camera.z >= near_plane_) || !std::isfinite(place.x + place.y)) return seen;
  seen.place = place;
  seen.in_front = true;
  if (!(place.x >= 0 && place.y >= 0 && place.x < camera_.width && place.y < camera_.height)) return seen;
  const float surface =
      depth_(static_cast<int64_t>(std::floor(place.y)), static_cast<int64_t>(std::floor(place.x)));
  seen.visible = !(surface > 0 && in_camera.z > (1 + behind) * surface);
  return seen;
}

std::vector<SeenTrack> seen_tracks(const Frame& frame, const Tracks& tracks) {
  std::vector<SeenTrack> seen;
  if (tracks.count() == 0) return seen;
  const PointViewer viewer(frame);
  for (int64_t p = 0; p < tracks.count(); ++p) {
    SeenTrack track;
    for (size_t v = 0; v < tracks.age.size(); ++v) {
      const SeenPoint point = viewer.see(load3<double>(&tracks.position(static_cast<int64_t>(v), p, 0)));
      if (!point.in_front || (v == 0 && !point.visible)) break;
      track.place.push_back(point.place);
      track.age.push_back(tracks.age[v]);
    }
    if (track.place.empty()) continue;
    track.colour = rainbow_colour(tracks.hue[static_cast<size_t>(p)]);
    seen.push_back(std::move(track));
  }
  return seen;
}

Tensor<float> track_picture(const Frame& frame, const Tracks& tracks) {
  Tensor<float> picture = frame.colour.on(Device::cpu);
  const std::vector<SeenTrack> seen = seen_tracks(frame, tracks);
  if (seen.empty()) return picture;
  Pen pen(picture);
  for (const SeenTrack& track : seen) pen.line(track, tracks.oldest);
  for (const SeenTrack& track : seen) pen.dot(track);
  return picture;
}

}  // namespace traceflow::viz
