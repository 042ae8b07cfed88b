#include "track/rescale.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "ops/motion/key_span.h"
#include "ops/motion/nodes.h"

namespace traceflow {

namespace {

// The ratios that are tried: 1 + size_step · i, for i from −most_steps to most_steps.
constexpr double size_step = 0.0025;
constexpr size_t most_steps = 60, sizes = 2 * most_steps + 1;
double growth(size_t i) { return size_step * (static_cast<double>(i) - static_cast<double>(most_steps)); }

Vec3<double> scaled(const Vec3<double>& point, const Vec3<double>& about, double by) {
  return about + by * (point - about);
}

int64_t nearest_key(const Motion& motion, float time) {
  int64_t nearest = 0;
  for (int64_t k = 1; k < motion.keys(); ++k) {
    if (std::abs(motion.time[k] - time) < std::abs(motion.time[nearest] - time)) nearest = k;
  }
  return nearest;
}

// How much of a body has left its first place, for each ratio at the k-th time.
std::array<double, sizes> costs_of_sizes(const Vec3<double>& eye, const Motion& motion, const Nodes& nodes,
                                         int32_t body, int64_t k) {
  constexpr double near = 0.5;  // radii
  constexpr double stays = 10;
  std::array<double, sizes> left{};
  double count = 0;
  for (int64_t n = 0; n < nodes.count(); ++n) {
    if (nodes.body[n] != body) continue;
    ++count;
    const Vec3<double> now = nodes::place_of(nodes, motion, n, k),
                       first = nodes::place_of(nodes, motion, n, 0);
    for (size_t i = 0; i < sizes; ++i) {
      const Vec3<double> off = (scaled(now, eye, 1 + growth(i)) - first) / (near * nodes.radius[n]);
      left[i] += dot(off, off) / (1 + dot(off, off));
    }
  }
  for (size_t i = 0; i < sizes; ++i) left[i] = left[i] / std::max(1.0, count) + stays * growth(i) * growth(i);
  return left;
}

}  // namespace

std::optional<std::vector<Vec3<double>>> positions_of_single_cameras(const Capture& capture,
                                                                     const Motion& motion) {
  std::vector<Vec3<double>> eyes;
  for (const float time : motion.time.values()) {
    const auto is_meant = [&](const View& view) { return view.time == time; };
    if (std::count_if(capture.train.begin(), capture.train.end(), is_meant) != 1) return std::nullopt;
    const auto view = std::find_if(capture.train.begin(), capture.train.end(), is_meant);
    eyes.emplace_back(view->camera.position);
  }
  return eyes;
}

void rescale_bodies(const std::vector<double>& ratio, const std::vector<Vec3<double>>& eyes, int64_t first,
                    Surfels& main, Motion& motion) {
  const auto towards = [](const Vec3<double>& from, const Vec3<double>& to, double by) {
    return to + (from - to) / by;
  };
  for (int64_t i = 0; i < main.count(); ++i) {
    const int32_t body = main.body[i];
    if (body < 0) continue;
    const double by = ratio[static_cast<size_t>(body)];
    float* const position = main.position.row(i);
    store3(position, towards(load3<double>(position), load3<double>(motion.centre.row(body)), by));
    for (int64_t axis = 0; axis < 2; ++axis) main.log_scale(i, axis) -= static_cast<float>(std::log(by));
  }
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    const Vec3<double> centre = load3<double>(motion.centre.row(b));
    for (int64_t key = first; key < motion.keys(); ++key) {
      float* const shift = &motion.shift(b, key, 0);
      const Vec3<double> at = centre + load3<double>(shift);
      store3(shift, towards(at, eyes[static_cast<size_t>(key)], ratio[static_cast<size_t>(b)]) - centre);
    }
  }
}

std::vector<double> ratios_of_what_moves(std::vector<double> ratio, const std::vector<Vec3<double>>& eyes,
                                         const Motion& motion) {
  constexpr double least = 3;
  const auto spread_of = [](const std::vector<Vec3<double>>& places) {
    Vec3<double> sum(0);
    double squares = 0;
    for (const Vec3<double>& place : places) sum += place;
    const Vec3<double> mean = sum / static_cast<double>(places.size());
    for (const Vec3<double>& place : places) squares += dot(place - mean, place - mean);
    return std::sqrt(squares);
  };
  for (size_t b = 0; b < ratio.size(); ++b) {
    std::vector<Vec3<double>> places, added;
    for (int64_t key = 0; key < motion.keys(); ++key) {
      const auto body = static_cast<int64_t>(b);
      const Vec3<double> place =
          load3<double>(motion.centre.row(body)) + load3<double>(&motion.shift(body, key, 0));
      places.push_back(place);
      added.push_back((1 / ratio[b] - 1) * (place - eyes[static_cast<size_t>(key)]));
    }
    if (spread_of(places) < least * spread_of(added)) ratio[b] = 1;
  }
  return ratio;
}

std::vector<double> standing_ratios(const std::vector<Vec3<double>>& eyes, const Motion& motion,
                                    const Nodes& nodes, int32_t body) {
  constexpr double steady = 30;
  constexpr double infinite = std::numeric_limits<double>::infinity();
  const auto times = static_cast<size_t>(nodes.times());
  std::vector<std::array<size_t, sizes>> came_from(times);
  std::array<double, sizes> best{};
  best.fill(infinite);
  best[most_steps] = 0;
  for (size_t k = 1; k < times; ++k) {
    const auto key = static_cast<size_t>(nearest_key(motion, nodes.time[static_cast<int64_t>(k)]));
    const std::array<double, sizes> here =
        costs_of_sizes(eyes[key], motion, nodes, body, static_cast<int64_t>(k));
    std::array<double, sizes> next{};
    for (size_t to = 0; to < sizes; ++to) {
      next[to] = infinite;
      for (size_t from = 0; from < sizes; ++from) {
        const double change = growth(to) - growth(from);
        const double cost = best[from] + steady * change * change;
        if (cost < next[to]) next[to] = cost, came_from[k][to] = from;
      }
      next[to] += here[to];
    }
    best = next;
  }
  std::vector<double> ratios(times, 1);
  auto at = static_cast<size_t>(std::min_element(best.begin(), best.end()) - best.begin());
  for (size_t k = times; k-- > 1; at = came_from[k][at]) ratios[k] = 1 + growth(at);
  return ratios;
}

void rescale_bent_body(const std::vector<double>& ratios, const std::vector<Vec3<double>>& eyes, int32_t body,
                       Motion& motion, Nodes& nodes) {
  const Vec3<double> pivot = load3<double>(motion.centre.row(body));
  for (int64_t n = 0; n < nodes.count(); ++n) {
    if (nodes.body[n] != body) continue;
    const Vec3<double> rest = load3<double>(nodes.centre.row(n));
    for (int64_t k = 0; k < nodes.times(); ++k) {
      float* const shift = &nodes.shift(n, k, 0);
      store3(shift, scaled(rest + load3<double>(shift), pivot, ratios[static_cast<size_t>(k)]) - rest);
    }
  }
  for (int64_t key = 0; key < motion.keys(); ++key) {
    const motion::KeySpan<float> span(nodes.time.data(), nodes.times(), motion.time[key]);
    const double from = ratios[static_cast<size_t>(span.from)], to = ratios[static_cast<size_t>(span.to)];
    float* const shift = &motion.shift(body, key, 0);
    store3(shift, scaled(pivot + load3<double>(shift), eyes[static_cast<size_t>(key)],
                         from + span.share * (to - from)) -
                      pivot);
  }
}

}  // namespace traceflow
