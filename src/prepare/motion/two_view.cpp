#include "prepare/motion/two_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <limits>

#include "base/random.h"
#include "math/symmetric_eigen.h"

namespace traceflow::prepare {

namespace {

using Kind = TwoView::Kind;
using Row = Eigen::Matrix<double, 9, 1>;  // an equation for the nine numbers of a matrix, row by row

Vec3<double> homogeneous(const Vec2<double>& p) { return {p, 1}; }

// Moves the mean to zero and scales the mean distance from it to √2. Otherwise the coefficients would differ
// by the square of the image width (Hartley 1997).
Mat3<double> to_unit(const std::vector<Track>& tracks, Vec2<double> Track::*place) {
  Vec2<double> mean(0);
  double spread = 0;
  const auto count = static_cast<double>(tracks.size());
  for (const Track& t : tracks) mean += t.*place / count;
  for (const Track& t : tracks) spread += length(t.*place - mean) / count;
  const double scale = spread > 0 ? std::sqrt(2.0) / spread : 1;
  Mat3<double> m(1);
  m[0][0] = m[1][1] = scale;
  m[2] = Vec3<double>(-scale * mean, 1);
  return m;
}

// The matrix of unit norm that best fits the equations of all tracks, in normalised coordinates.
template <class F>
Mat3<double> null_matrix(const std::vector<Track>& tracks, const Mat3<double>& unit_from,
                         const Mat3<double>& unit_to, F&& equations_of) {
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (const Track& t : tracks) {
    const Vec3<double> a = unit_from * homogeneous(t.from), b = unit_to * homogeneous(t.to);
    for (const Row& row : equations_of(a, b)) normal += row * row.transpose();
  }
  const Row null = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>>(normal).eigenvectors().col(0);
  Mat3<double> m;
  std::copy_n(null.data(), 9, &m[0][0]);
  return transpose(m);
}

Mat3<double> normalised(const Mat3<double>& m) {
  const double norm = Eigen::Map<const Row>(&m[0][0]).norm();
  return norm > 0 ? m / norm : m;
}

// The nearest matrix of rank 2: removes the smallest singular value.
Mat3<double> rank_two(const Mat3<double>& m) {
  const Vec3<double> null = symmetric_eigen(transpose(m) * m).vectors[0];
  return m - outerProduct(m * null, null);
}

// Sum of truncated squared errors: all outliers cost the same.
double cost(const TwoView& model, const std::vector<Track>& tracks, double tolerance) {
  double sum = 0;
  for (const Track& t : tracks) {
    const double d = model.distance(t) / tolerance;
    // Also for NaN.
    sum += d < 1 ? d * d : 1;
  }
  return sum;
}

std::vector<Track> obeying(const TwoView& model, const std::vector<Track>& tracks, double tolerance) {
  std::vector<Track> kept;
  std::ranges::copy_if(tracks, std::back_inserter(kept),
                       [&](const Track& t) { return model.distance(t) < tolerance; });
  return kept;
}

std::vector<Track> draw(const std::vector<Track>& tracks, size_t count, Random& random) {
  std::vector<size_t> chosen;
  while (chosen.size() < count) {
    const auto i = static_cast<size_t>(random.below(static_cast<int64_t>(tracks.size())));
    if (std::ranges::find(chosen, i) == chosen.end()) chosen.push_back(i);
  }
  std::vector<Track> sample;
  sample.reserve(count);
  for (const size_t i : chosen) sample.push_back(tracks[i]);
  return sample;
}

TwoView fit(Kind kind, const std::vector<Track>& tracks) {
  return kind == Kind::homography ? fit_homography(tracks) : fit_fundamental(tracks);
}

// Samples until at least one sample contains only inliers with a probability of 99.9 %.
TwoView sample_consensus(Kind kind, const std::vector<Track>& tracks, double tolerance, Random& random) {
  constexpr int refinements = 4;
  constexpr double most = 1500, least = 30, missed = 1e-3;
  const size_t needed = kind == Kind::homography ? 4 : 8;
  TwoView best{kind};
  double best_cost = std::numeric_limits<double>::infinity();
  const auto keep_if_better = [&](const TwoView& model) {
    const double c = cost(model, tracks, tolerance);
    if (!(c < best_cost)) return false;
    best_cost = c;
    best = model;
    return true;
  };
  double wanted = most;
  for (int i = 0; i < wanted; ++i) {
    if (!keep_if_better(fit(kind, draw(tracks, needed, random)))) continue;
    const double share =
        static_cast<double>(obeying(best, tracks, tolerance).size()) / static_cast<double>(tracks.size());
    const double all_obey = std::clamp(std::pow(share, static_cast<double>(needed)), 1e-9, 1 - 1e-9);
    wanted = std::clamp(std::log(missed) / std::log1p(-all_obey), least, most);
  }
  for (int i = 0; i < refinements; ++i) {
    const std::vector<Track> agreeing = obeying(best, tracks, tolerance);
    if (agreeing.size() < needed || !keep_if_better(fit(kind, agreeing))) break;
  }
  return best;
}

}  // namespace

double TwoView::distance(const Track& track) const {
  const Vec3<double> from = homogeneous(track.from), to = homogeneous(track.to);
  const Vec3<double> image = matrix * from;
  if (kind == Kind::homography) {
    return image.z != 0 ? length(Vec2<double>(image) / image.z - track.to)
                        : std::numeric_limits<double>::infinity();
  }
  const Vec3<double> back = to * matrix;
  const double slope = std::sqrt(image.x * image.x + image.y * image.y + back.x * back.x + back.y * back.y);
  return slope > 0 ? std::abs(dot(to, image)) / slope : 0;
}

TwoView fit_homography(const std::vector<Track>& tracks) {
  const Mat3<double> from = to_unit(tracks, &Track::from), to = to_unit(tracks, &Track::to);
  const Mat3<double> h = null_matrix(tracks, from, to, [](const Vec3<double>& a, const Vec3<double>& b) {
    return std::array<Row, 2>{Row{a.x, a.y, 1, 0, 0, 0, -b.x * a.x, -b.x * a.y, -b.x},
                              Row{0, 0, 0, a.x, a.y, 1, -b.y * a.x, -b.y * a.y, -b.y}};
  });
  return {Kind::homography, normalised(inverse(to) * h * from)};
}

TwoView fit_fundamental(const std::vector<Track>& tracks) {
  const Mat3<double> from = to_unit(tracks, &Track::from), to = to_unit(tracks, &Track::to);
  const Mat3<double> f = null_matrix(tracks, from, to, [](const Vec3<double>& a, const Vec3<double>& b) {
    return std::array<Row, 1>{Row{b.x * a.x, b.x * a.y, b.x, b.y * a.x, b.y * a.y, b.y, a.x, a.y, 1}};
  });
  return {Kind::fundamental, normalised(transpose(to) * rank_two(f) * from)};
}

std::optional<TwoView> fit_two_view(const std::vector<Track>& tracks, double tolerance, uint64_t seed) {
  constexpr double fewest = 12, nearly = 0.85;
  if (static_cast<double>(tracks.size()) < fewest) return std::nullopt;
  Random random(seed);
  const TwoView plane = sample_consensus(Kind::homography, tracks, tolerance, random);
  const TwoView lines = sample_consensus(Kind::fundamental, tracks, tolerance, random);
  const auto in_plane = static_cast<double>(obeying(plane, tracks, tolerance).size());
  const auto on_lines = static_cast<double>(obeying(lines, tracks, tolerance).size());
  if (std::max(in_plane, on_lines) < fewest) return std::nullopt;
  return in_plane >= nearly * on_lines ? plane : lines;
}

TwoView in_larger_pixels(const TwoView& view, double factor) {
  Mat3<double> larger(1 / factor);
  // Coordinates start at the centre of the first pixel, which moves when pixels become larger.
  larger[2] = Vec3<double>(0.5 / factor - 0.5, 0.5 / factor - 0.5, 1);
  const Mat3<double> back = inverse(larger);
  const bool is_plane = view.kind == Kind::homography;
  return {view.kind, normalised((is_plane ? larger : transpose(back)) * view.matrix * back)};
}

TwoView epipolar_lines(const PlacedCamera& from, const PlacedCamera& to) {
  const Vec3<double> t = to.camera_from_world * (from.position - to.position);
  const Mat3<double> cross_t(0, t.z, -t.y, -t.z, 0, t.x, t.y, -t.x, 0);
  const Mat3<double> essential = cross_t * to.camera_from_world * transpose(from.camera_from_world);
  return {Kind::fundamental,
          normalised(transpose(inverse(to.pixel_from_camera)) * essential * inverse(from.pixel_from_camera))};
}

}  // namespace traceflow::prepare
