#include "viz/tracks.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "math/activation.h"
#include "ops/deform/deform.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"

namespace traceflow::viz {

namespace {

constexpr int usual_steps = 60;
// Minimum opacity of a point at every examined time.
constexpr float least_opacity = 0.3F;
// If there are more surfels, an even sample is examined, at this many times: about as much work as posing one
// or two frames.
constexpr size_t most_candidates = 16384, most_looks = 9;
// Minimum distance between points, as a fraction of the extent of all.
constexpr float least_gap = 1.0F / 40;

std::vector<float> times_of_scene(const Scene& scene) {
  if (scene.main_motion && scene.main_motion->keys() > 0) {
    const Tensor<float> keys = scene.main_motion->time.on(Device::cpu);
    return {keys.data(), keys.data() + keys.size()};
  }
  std::vector<float> times;
  for (int i = 0; i <= usual_steps; ++i) times.push_back(static_cast<float>(i) / usual_steps);
  return times;
}

// At most `most` evenly spaced times, including the first and the last.
std::vector<float> spread(const std::vector<float>& times, size_t most) {
  if (times.size() <= most) return times;
  std::vector<float> some;
  for (size_t i = 0; i < most; ++i) some.push_back(times[i * (times.size() - 1) / (most - 1)]);
  return some;
}

// The index of a time among those of the capture, with a fraction between two of them.
double place_among(const std::vector<float>& times, float time) {
  const auto next = std::upper_bound(times.begin(), times.end(), time);
  if (next == times.begin()) return 0;
  const double before = static_cast<double>(next - times.begin()) - 1;
  if (next == times.end()) return before;
  return before + (double{time} - *(next - 1)) / (double{*next} - *(next - 1));
}

// Takes each point that is at least `gap` away from all points taken before, until there are more than
// `most`.
std::vector<size_t> apart(const std::vector<Vec3<float>>& points, float gap, size_t most) {
  std::vector<size_t> taken;
  for (size_t i = 0; i < points.size() && taken.size() <= most; ++i) {
    const bool is_free = std::ranges::none_of(taken, [&](size_t other) {
      const Vec3<float> d = points[i] - points[other];
      return dot(d, d) < gap * gap;
    });
    if (is_free) taken.push_back(i);
  }
  return taken;
}

// The diagonal of the box around the points without the outermost twentieth at each end of each axis, so that
// outliers do not count.
float size_of(const std::vector<Vec3<float>>& points) {
  Vec3<float> sides(0);
  std::vector<float> values(points.size());
  for (int axis = 0; axis < 3; ++axis) {
    std::ranges::transform(points, values.begin(), [&](const auto& p) { return p[axis]; });
    std::ranges::sort(values);
    const size_t left_out = values.size() / 20;
    sides[axis] = values[values.size() - 1 - left_out] - values[left_out];
  }
  return length(sides);
}

// At most `most` points, evenly spread over space: with the smallest gap that gives no more. Earlier points
// are preferred.
std::vector<size_t> spread_out(const std::vector<Vec3<float>>& points, size_t most) {
  if (points.empty()) return {};
  float too_near = least_gap * size_of(points);
  std::vector<size_t> taken = apart(points, too_near, most);
  if (taken.size() <= most) return taken;
  Vec3<float> low(HUGE_VALF), high(-HUGE_VALF);
  for (const Vec3<float>& p : points) {
    low = min(low, p);
    high = max(high, p);
  }
  float far = 2 * length(high - low);
  constexpr int halvings = 14;
  for (int i = 0; i < halvings; ++i) {
    const float gap = (too_near + far) / 2;
    (apart(points, gap, most).size() <= most ? far : too_near) = gap;
  }
  return apart(points, far, most);
}

// The rank of each point along the axis of largest variance, as a fraction. Points close together get similar
// colours, so that diverging tracks are visible.
std::vector<float> hues_of(const std::vector<Vec3<float>>& points) {
  Vec3<double> sum(0), squares(0);
  for (const Vec3<float>& p : points) {
    sum += Vec3<double>(p);
    squares += Vec3<double>(p) * Vec3<double>(p);
  }
  const auto count = static_cast<double>(points.size());
  const Vec3<double> variance = squares / count - (sum / count) * (sum / count);
  int axis = 0;
  for (int a = 1; a < 3; ++a) axis = variance[a] > variance[axis] ? a : axis;
  std::vector<size_t> order(points.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::stable_sort(order, [&](size_t a, size_t b) { return points[a][axis] < points[b][axis]; });
  std::vector<float> hue(points.size());
  for (size_t rank = 0; rank < order.size(); ++rank)
    hue[order[rank]] = static_cast<float>((static_cast<double>(rank) + 0.5) / count);
  return hue;
}

}  // namespace

TrackFollower::TrackFollower(const Scene& scene, const FrameRequest& request, const RenderOptions& options,
                             std::vector<float> times)
    : options_(options.tracks),
      precision_(options.precision),
      deforms_(request.deform_main),
      times_(times.empty() ? times_of_scene(scene) : std::move(times)) {
  choose(scene);
}

TrackFollower::Places TrackFollower::places(const Scene& scene, float time,
                                            const Tensor<int32_t>& rows) const {
  const Field* field = deforms_ && scene.main_field ? &*scene.main_field : nullptr;
  PosedSurfels posed;
  deform::forward(scene.main, field, time, rows, 0, precision_, posed, nullptr);
  if (scene.main_nodes)
    nodes::forward(*scene.main_nodes, scene.main.body, time, rows, posed, *nodes::make_saved());
  if (scene.main_motion)
    motion::forward(*scene.main_motion, scene.main.body, time, rows, posed, *motion::make_saved());
  return {posed.position.on(Device::cpu), posed.opacity.on(Device::cpu)};
}

std::vector<int32_t> TrackFollower::candidates(const Scene& scene) const {
  const bool has_field = deforms_ && scene.main_field, has_motion = scene.main_motion.has_value();
  if (!has_field && !has_motion) return {};
  const Tensor<float> logit = scene.main.opacity_logit.on(Device::cpu);
  const Tensor<int32_t> body = scene.main.body.on(Device::cpu);
  std::vector<int32_t> rows;
  for (int64_t i = 0; i < logit.size(); ++i) {
    const int32_t carrier = body.empty() ? moved_by_field : body[i];
    const bool may_move = carrier >= 0 ? has_motion : carrier == moved_by_field && has_field;
    if (may_move && sigmoid(logit[i]) >= least_opacity) rows.push_back(static_cast<int32_t>(i));
  }
  if (rows.size() <= most_candidates) return rows;
  std::vector<int32_t> share(most_candidates);
  for (size_t k = 0; k < share.size(); ++k) share[k] = rows[k * rows.size() / most_candidates];
  return share;
}

void TrackFollower::choose(const Scene& scene) {
  const std::vector<int32_t> rows = candidates(scene);
  if (rows.empty()) return;
  const Tensor<int32_t> looked_at = tensor_of(rows).on(scene.device());

  // Measure how far each surfel moves from its first position, and its lowest opacity.
  const std::vector<float> looks = spread(times_, most_looks);
  const Places first = places(scene, looks[0], looked_at);
  std::vector<float> moved(rows.size(), 0), opacity(rows.size(), 1);
  for (const float time : looks) {
    const Places now = places(scene, time, looked_at);
    for (size_t k = 0; k < rows.size(); ++k) {
      const auto i = static_cast<int64_t>(k);
      const Vec3<float> d = load3<float>(now.position.row(i)) - load3<float>(first.position.row(i));
      const float away = length(d);
      opacity[k] = std::isfinite(away) ? std::min(opacity[k], now.opacity[i]) : 0;
      moved[k] = std::max(moved[k], away);
    }
  }

  // Keep the most opaque of those that move, with gaps between them.
  std::vector<int64_t> movers;
  for (size_t k = 0; k < rows.size(); ++k) {
    if (opacity[k] >= least_opacity && moved[k] >= options_.least_move * scene.extent && moved[k] > 0)
      movers.push_back(static_cast<int64_t>(k));
  }
  std::ranges::stable_sort(movers, [&](int64_t a, int64_t b) {
    return opacity[static_cast<size_t>(a)] > opacity[static_cast<size_t>(b)];
  });
  std::vector<Vec3<float>> points;
  points.reserve(movers.size());
  for (const int64_t k : movers) points.push_back(load3<float>(first.position.row(k)));
  std::vector<int64_t> kept;
  for (const size_t k : spread_out(points, static_cast<size_t>(options_.most))) kept.push_back(movers[k]);
  if (kept.empty()) return;

  // In surfel order, each with its hue.
  std::ranges::sort(kept);
  std::vector<int32_t> chosen;
  points.clear();
  for (const int64_t k : kept) {
    chosen.push_back(rows[static_cast<size_t>(k)]);
    points.push_back(load3<float>(first.position.row(k)));
  }
  hue_ = hues_of(points);
  chosen_ = tensor_of(chosen).on(scene.device());
}

Tensor<float> TrackFollower::positions(const Scene& scene, float time) const {
  return places(scene, time, chosen_).position;
}

Tracks TrackFollower::at(const Scene& scene, float time) const {
  Tracks tracks;
  if (hue_.empty()) return tracks;
  tracks.hue = hue_;
  tracks.oldest = static_cast<float>(options_.frames);
  const double place = place_among(times_, time);
  std::vector<float> when = {time};
  tracks.age = {0};
  for (auto i = static_cast<int64_t>(std::floor(place)); i >= 0; --i) {
    const double age = place - static_cast<double>(i);
    if (age > options_.frames) break;
    const float earlier = times_[static_cast<size_t>(i)];
    if (!(earlier < time)) continue;
    when.push_back(earlier);
    tracks.age.push_back(static_cast<float>(age));
  }
  tracks.position.resize({static_cast<int64_t>(when.size()), tracks.count(), 3});
  for (size_t v = 0; v < when.size(); ++v) {
    const Tensor<float> position = positions(scene, when[v]);
    std::copy_n(position.data(), position.size(), tracks.position.row(static_cast<int64_t>(v)));
  }
  return tracks;
}

}  // namespace traceflow::viz
