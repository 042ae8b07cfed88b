#include "prepare/motion/motion.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "base/robust.h"

namespace traceflow::prepare {

namespace {

// The motion of the tracks nearest to a place: the median of each coordinate.
std::optional<Vec2<double>> shift_around(const Vec2<double>& place, const std::vector<Track>& tracks) {
  constexpr size_t asked = 5;
  if (tracks.size() < asked) return std::nullopt;
  std::vector<std::pair<double, size_t>> apart;
  apart.reserve(tracks.size());
  for (size_t i = 0; i < tracks.size(); ++i) {
    const Vec2<double> d = tracks[i].from - place;
    apart.emplace_back(dot(d, d), i);
  }
  std::partial_sort(apart.begin(), apart.begin() + asked, apart.end());
  std::vector<double> x, y;
  for (size_t k = 0; k < asked; ++k) {
    const Track& t = tracks[apart[k].second];
    x.push_back(t.to.x - t.from.x);
    y.push_back(t.to.y - t.from.y);
  }
  return Vec2<double>(median(std::move(x)), median(std::move(y)));
}

}  // namespace

double limit_of(const Motion& motion) {
  std::vector<double> obeying;
  for (const Track& t : motion.tracks) {
    const double d = motion.still.distance(t);
    if (d < 2 * stillness) obeying.push_back(d);
  }
  return std::max(stillness, 4 * 1.4826 * median(std::move(obeying)));
}

void look_again(Motion& motion, const Pyramid& from, const Pyramid& to) {
  constexpr int rounds = 3;  // each extends a little farther into the tracks that do not follow
  constexpr double as_alike = 1.25, noise = 0.5;
  const double limit = limit_of(motion);
  for (int round = 0; round < rounds; ++round) {
    std::vector<Track> obeying;
    std::ranges::copy_if(motion.tracks, std::back_inserter(obeying),
                         [&](const Track& t) { return motion.still.distance(t) <= limit; });
    for (Track& t : motion.tracks) {
      if (motion.still.distance(t) <= limit) continue;
      const auto shift = shift_around(t.from, obeying);
      if (!shift) return;
      const auto other = track_near(from, to, t.from, *shift);
      if (other && motion.still.distance(*other) <= limit &&
          other->difference <= as_alike * t.difference + noise)
        t = *other;
    }
  }
}

}  // namespace traceflow::prepare
