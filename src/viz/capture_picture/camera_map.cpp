#include "viz/capture_picture/camera_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "math/symmetric_eigen.h"

namespace traceflow::viz {

namespace {

constexpr double margin = 24;          // pixels around the map's content
constexpr double look_length = 16;     // pixels
constexpr int64_t most_points = 4000;  // used to choose the window

Vec3<double> axis_of(const View& view, const Vec3<float>& in_camera) {
  return Vec3<double>(in_camera * view.camera.camera_from_world);
}

// Any unit vector perpendicular to v.
Vec3<double> across(const Vec3<double>& v) {
  const Vec3<double> other = std::abs(v.x) < 0.7 ? Vec3<double>(1, 0, 0) : Vec3<double>(0, 1, 0);
  return normalize(cross(v, other));
}

Vec3<double> unit_or(const Vec3<double>& v, const Vec3<double>& otherwise) {
  constexpr double shortest = 1e-3;
  return length(v) > shortest ? normalize(v) : otherwise;
}

// The direction perpendicular to all cameras' x axes, if they rotate enough to determine it; else the
// cameras' mean up direction.
Vec3<double> up_of(const Capture& capture) {
  constexpr double trust = 0.005;  // of the mean up direction: outweighed by rotations of a few degrees
  Vec3<double> mean(0);
  Mat3<double> spread(0);
  for (const View& view : capture.train) {
    const Vec3<double> right = axis_of(view, {1, 0, 0});
    spread += outerProduct(right, right);
    mean += axis_of(view, {0, -1, 0});
  }
  const auto count = static_cast<double>(capture.train.size());
  mean = unit_or(mean / count, {0, 0, 1});
  const Vec3<double> up = symmetric_eigen(spread / count - trust * outerProduct(mean, mean)).vectors[0];
  return dot(up, mean) < 0 ? -up : up;
}

// The points that a quarter of the training views have in their images; all points if there are none.
std::vector<Vec3<double>> subject_of(const Capture& capture) {
  const int64_t step = 1 + capture.points.size() / 3 / most_points;
  std::vector<Vec3<double>> all, seen;
  for (int64_t i = 0; i < capture.points.size() / 3; i += step) {
    const Vec3<float> point = load3<float>(capture.points.row(i));
    all.emplace_back(point);
    const auto views =
        std::ranges::count_if(capture.train, [&](const View& view) { return view.camera.sees(point); });
    if (4 * views >= static_cast<std::ptrdiff_t>(capture.train.size())) seen.push_back(all.back());
  }
  return seen.empty() ? all : seen;
}

class Map {
 public:
  Map(const Capture& capture, const Marks& marks, const MapAxes& axes, const Pixel& size)
      : capture_(capture), marks_(marks), axes_(axes), picture_(Shape{size.y, size.x, 3}) {
    fill_box({0, 0}, size, paper, picture_);
    draw_box({0, 0}, size, 1, pale_ink, picture_);
    choose_window();
  }

  Tensor<uint8_t> draw(const std::string& title) {
    draw_points();
    for (const View& view : capture_.train) draw_camera(view, false);
    for (const View& view : capture_.test) draw_camera(view, true);
    write_text(title, {8, 8}, text_ink, picture_);
    draw_scale();
    return std::move(picture_);
  }

 private:
  Vec2<double> flat(const Vec3<double>& x) const { return {dot(x, axes_.right), dot(x, axes_.up)}; }

  void choose_window() {
    std::vector<double> along[2];
    for (const Vec3<double>& point : subject_of(capture_)) {
      const Vec2<double> at = flat(point);
      for (int k = 0; k < 2; ++k) along[k].push_back(at[k]);
    }
    low_ = Vec2<double>(HUGE_VAL), high_ = Vec2<double>(-HUGE_VAL);
    for (int k = 0; k < 2 && !along[k].empty(); ++k) {
      std::ranges::sort(along[k]);
      low_[k] = along[k][along[k].size() / 20];
      high_[k] = along[k][along[k].size() - 1 - along[k].size() / 20];
    }
    for (const auto* split : {&capture_.train, &capture_.test}) {
      for (const View& view : *split) {
        const auto mark = marks_.find(view.id);
        if (mark != marks_.end() && mark->second == apart_kind) continue;
        const Vec2<double> at = flat(Vec3<double>(view.camera.position));
        low_ = min(low_, at);
        high_ = max(high_, at);
      }
    }
    if (!(high_.x >= low_.x)) low_ = Vec2<double>(-1), high_ = Vec2<double>(1);
    const Vec2<double> room(static_cast<double>(picture_.dim(1)) - 2 * margin,
                            static_cast<double>(picture_.dim(0)) - 2 * margin);
    const Vec2<double> span = max(high_ - low_, Vec2<double>(1e-9));
    scale_ = std::min(room.x / span.x, room.y / span.y);
  }

  Vec2<double> place(const Vec3<double>& x) const {
    const Vec2<double> from_middle = scale_ * (flat(x) - 0.5 * (low_ + high_));
    return {0.5 * static_cast<double>(picture_.dim(1)) + from_middle.x,
            0.5 * static_cast<double>(picture_.dim(0)) - from_middle.y};
  }

  // More points in a pixel make it brighter.
  void draw_points() {
    const int64_t width = picture_.dim(1), height = picture_.dim(0);
    std::vector<int> counts(static_cast<size_t>(width * height), 0);
    for (int64_t i = 0; i < capture_.points.size() / 3; ++i) {
      const Vec2<double> at = place(load3<double>(capture_.points.row(i)));
      if (!(at.x >= 0 && at.y >= 0 && at.x < static_cast<double>(width) &&
            at.y < static_cast<double>(height)))
        continue;
      ++counts[static_cast<size_t>(static_cast<int64_t>(at.y) * width + static_cast<int64_t>(at.x))];
    }
    for (size_t i = 0; i < counts.size(); ++i) {
      if (counts[i] == 0) continue;
      const auto light = static_cast<uint8_t>(std::min(170, 80 + 30 * counts[i]));
      const auto n = static_cast<int64_t>(i);
      fill_box({n % width, n / width}, {1, 1}, {light, light, light}, picture_);
    }
  }

  void draw_camera(const View& view, bool is_test) {
    const Vec2<double> border(12, 28);  // below the title
    const Vec2<double> size(static_cast<double>(picture_.dim(1)), static_cast<double>(picture_.dim(0)));
    const Vec2<double> at = clamp(place(Vec3<double>(view.camera.position)), border, size - border);
    const Vec2<double> look = flat(axis_of(view, {0, 0, 1}));
    const Ink ink = time_ink(view.time);
    draw_line(at, at + look_length * Vec2<double>(look.x, -look.y), ink, picture_);
    draw_ring(at, 0, 3, ink, picture_);
    const Pixel corner(std::lround(at.x) - 5, std::lround(at.y) - 5);
    if (is_test) draw_box(corner, {10, 10}, 1, test_ink, picture_);
    if (marks_.contains(view.id)) draw_ring(at, 6.5, 8.5, alarm_ink, picture_);
  }

  // A scale bar of a round length.
  void draw_scale() {
    const double wanted = 0.25 * static_cast<double>(picture_.dim(1)) / scale_;
    const double decade = std::pow(10, std::floor(std::log10(wanted)));
    const double bar = wanted >= 5 * decade ? 5 * decade : wanted >= 2 * decade ? 2 * decade : decade;
    const Pixel at{8, picture_.dim(0) - 14};
    fill_box(at, {std::lround(bar * scale_), 3}, text_ink, picture_);
    write_text(fmt::format("{:g}", bar), {at.x, at.y - letter_height - 3}, text_ink, picture_);
  }

  const Capture& capture_;
  const Marks& marks_;
  const MapAxes axes_;
  Tensor<uint8_t> picture_;
  Vec2<double> low_{0}, high_{0};
  double scale_ = 1;  // pixels per unit
};

}  // namespace

MapViews map_views(const Capture& capture) {
  const Vec3<double> up = up_of(capture);
  Vec3<double> ahead(0);
  for (const View& view : capture.train) ahead += axis_of(view, {0, 0, 1});
  ahead /= static_cast<double>(capture.train.size());
  const Vec3<double> level = unit_or(ahead - dot(ahead, up) * up, across(up));
  return {{cross(level, up), level}, {level, up}};
}

Tensor<uint8_t> camera_map(const Capture& capture, const Marks& marks, const MapAxes& axes,
                           const std::string& title, const Pixel& size) {
  return Map(capture, marks, axes, size).draw(title);
}

}  // namespace traceflow::viz
