#include "eval/motion_error.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>

#include "eval/median.h"
#include "math/similarity_fit.h"
#include "scene/neighbours.h"

namespace traceflow::eval {

namespace {

using Points = std::vector<Vec3<double>>;

constexpr int carriers_of_a_point = 8;
constexpr double kernel_width = 0.02;  // standard deviation of the weights, capture units
constexpr double least_weight = 1e-3;  // of all carriers: the nearest is within 3.7 standard deviations
constexpr size_t least_points = 4;     // of an object with metrics
constexpr int sampled_times = 8;

Points points_at(const MotionTruth& truth, int64_t time) {
  Points points(static_cast<size_t>(truth.count()));
  for (int64_t i = 0; i < truth.count(); ++i)
    points[static_cast<size_t>(i)] = load3<double>(&truth.points(time, i, 0));
  return points;
}

// The surfels that carry each point, with their weights.
class Hold {
 public:
  Hold(const Points& points, const Carriers& surfels)
      : surfels_(surfels), point_(points), carriers_(points.size()) {
    Tensor<float> queries({static_cast<int64_t>(points.size()), 3});
    for (size_t i = 0; i < points.size(); ++i) store3(queries.row(static_cast<int64_t>(i)), points[i]);
    const Neighbours near = nearest_of(convert<float>(surfels.rest), queries, carriers_of_a_point);
    std::map<int32_t, size_t> places;
    for (size_t i = 0; i < points.size(); ++i) {
      double sum = 0;
      for (int k = 0; k < carriers_of_a_point; ++k) {
        const int32_t surfel = near.index(static_cast<int64_t>(i), k);
        if (surfel < 0) continue;
        const Vec3<double> aside = load3<double>(surfels.rest.row(surfel)) - points[i];
        const double weight = std::exp(-0.5 * dot(aside, aside) / (kernel_width * kernel_width));
        const auto [place, is_new] = places.emplace(surfel, listed_.size());
        if (is_new) listed_.push_back(surfel);
        carriers_[i].push_back({place->second, weight});
        sum += weight;
      }
      if (!(sum > least_weight)) carriers_[i].clear();
      for (Carrier& carrier : carriers_[i]) carrier.weight /= sum;
    }
  }

  bool holds(size_t point) const { return !carriers_[point].empty(); }

  // Positions of the points at a time; points without carriers stay.
  Points at(float time) const {
    const Tensor<double> now = surfels_.at(listed_, time);
    Points moved = point_;
    for (size_t i = 0; i < moved.size(); ++i) {
      for (const Carrier& carrier : carriers_[i]) {
        const Vec3<double> step = load3<double>(now.row(static_cast<int64_t>(carrier.listed))) -
                                  load3<double>(surfels_.rest.row(listed_[carrier.listed]));
        if (std::isfinite(dot(step, step))) moved[i] += carrier.weight * step;
      }
    }
    return moved;
  }

 private:
  struct Carrier {
    size_t listed;  // in listed_
    double weight;
  };
  const Carriers& surfels_;
  const Points point_;
  std::vector<int32_t> listed_;
  std::vector<std::vector<Carrier>> carriers_;
};

double median_distance(const Points& a, const Points& b) {
  std::vector<double> distances(a.size());
  for (size_t i = 0; i < a.size(); ++i) distances[i] = length(a[i] - b[i]);
  return median(std::span<double>(distances));
}

MotionMoment moment_of(double time, const Points& rest, const Points& truth, const Points& moved) {
  const Similarity fitted = fit_similarity(rest, moved), true_fit = fit_similarity(rest, truth);
  MotionMoment m;
  m.time = time;
  m.moved = median_distance(truth, rest);
  m.missed = median_distance(truth, moved);
  m.rotation_error_deg = rotation_angle_deg(fitted.rotation * transpose(true_fit.rotation));
  m.scale = fitted.scale;
  m.true_scale = true_fit.scale;
  return m;
}

// Means over the sampled times. Also sets the shares of the curve.
MotionFigures figures_of(std::vector<MotionMoment>& curve) {
  const auto mean_of_sampled = [&](double MotionMoment::*figure) {
    double sum = 0;
    for (int k = 1; k <= sampled_times; ++k) {
      const auto last = static_cast<double>(curve.size() - 1);
      sum += curve[static_cast<size_t>(std::nearbyint(k * last / sampled_times))].*figure;
    }
    return sum / sampled_times;
  };
  MotionFigures f;
  f.moved = mean_of_sampled(&MotionMoment::moved);
  f.missed = mean_of_sampled(&MotionMoment::missed);
  f.rotation_error_deg = mean_of_sampled(&MotionMoment::rotation_error_deg);
  f.scale = mean_of_sampled(&MotionMoment::scale);
  f.true_scale = mean_of_sampled(&MotionMoment::true_scale);
  if (*f.moved > 0) {
    f.share = *f.missed / *f.moved;
    for (MotionMoment& m : curve) m.share = m.missed / *f.moved;
  }
  return f;
}

MotionFigures mean_by_points(const std::vector<ObjectMotion>& objects) {
  std::vector<double> sums, weights;
  for (const ObjectMotion& o : objects) {
    size_t next = 0;
    MotionFigures::visit(o.figures, [&](const char*, const std::optional<double>& value) {
      if (sums.size() <= next) sums.push_back(0), weights.push_back(0);
      const auto weight = static_cast<double>(value ? o.followed_points : 0);
      sums[next] += weight * value.value_or(0);
      weights[next++] += weight;
    });
  }
  MotionFigures mean;
  size_t next = 0;
  MotionFigures::visit(mean, [&](const char*, std::optional<double>& value) {
    if (weights[next] > 0) value = sums[next] / weights[next];
    ++next;
  });
  return mean;
}

}  // namespace

MotionReport motion_error(const MotionTruth& truth, const Carriers& surfels) {
  const Points rest = points_at(truth, 0);
  const Hold hold(rest, surfels);
  MotionReport report;
  std::map<int32_t, std::vector<size_t>> held;
  for (size_t i = 0; i < rest.size(); ++i) {
    std::vector<size_t>& points = held[truth.object[static_cast<int64_t>(i)]];
    if (hold.holds(i)) points.push_back(i);
  }
  report.objects.reserve(held.size());
  for (const auto& [object, points] : held) {
    const auto all = std::ranges::count(truth.object.values(), object);
    report.objects.push_back({object, all, static_cast<int64_t>(points.size()), {}, {}});
  }

  const auto chosen = [](const Points& from, const std::vector<size_t>& indices) {
    Points points;
    points.reserve(indices.size());
    for (const size_t i : indices) points.push_back(from[i]);
    return points;
  };
  for (int64_t t = 0; t < truth.times(); ++t) {
    const double time = static_cast<double>(t) / static_cast<double>(truth.times() - 1);
    const Points now = points_at(truth, t), moved = hold.at(static_cast<float>(time));
    for (ObjectMotion& o : report.objects) {
      const std::vector<size_t>& points = held.at(o.object);
      if (points.size() < least_points) continue;
      o.curve.push_back(moment_of(time, chosen(rest, points), chosen(now, points), chosen(moved, points)));
    }
  }
  for (ObjectMotion& o : report.objects) {
    if (!o.curve.empty()) o.figures = figures_of(o.curve);
  }
  report.mean = mean_by_points(report.objects);
  return report;
}

}  // namespace traceflow::eval
