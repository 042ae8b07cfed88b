#include "track/pose_solver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <utility>

#include "base/parallel.h"
#include "math/rotation_group.h"
#include "ops/deform/deform.h"
#include "ops/motion/nodes.h"
#include "ops/raster/body_jacobian.h"
#include "track/gaussian_blur.h"
#include "track/prior_bias.h"

namespace traceflow {

namespace {

constexpr int pose_size = 6;
constexpr int channels = 7;  // silhouette, normal, colour
constexpr double huber = 0.05;
constexpr double blur_falls = 0.7;
// The largest rotation of a step, in radians, and its largest translation, in radii of the body.
constexpr double most_turn = 0.1, most_shift = 0.15;
constexpr double relative_damping = 1e-3, least_damping = 1e-3;
constexpr double pi = 3.141592653589793;
constexpr int tries = 3;
constexpr double shorter = 0.4;

// Solves a x = b for a symmetric positive definite a (n×n).
std::vector<double> solve_symmetric(const std::vector<double>& a, const std::vector<double>& b) {
  const auto n = static_cast<Eigen::Index>(b.size());
  std::vector<double> x(b.size());
  const Eigen::Map<const Eigen::MatrixXd> matrix(a.data(), n, n);
  Eigen::Map<Eigen::VectorXd>(x.data(), n) =
      matrix.ldlt().solve(Eigen::Map<const Eigen::VectorXd>(b.data(), n));
  return x;
}

// Corrects priors by the bias of those outside the mask.
void turn_by_surroundings(const raster::Output& picture, TrackTarget& target) {
  PriorBias surroundings;
  for (int64_t i = 0; i < picture.alpha.size(); ++i) {
    if (picture.alpha[i] < 0.9F || (!target.mask.empty() && target.mask[i] != 0)) continue;
    surroundings.add(target.camera, load3<double>(picture.normal.data() + 3 * i),
                     load3<double>(target.normal_prior.data() + 3 * i));
  }
  const std::optional<Mat3<double>> bias = surroundings.rotation();
  if (!bias) return;
  const Mat3<float> turn = inverse_of_bias(target.camera, *bias);
  for (int64_t i = 0; i < target.normal_prior.size(); i += 3)
    store3(&target.normal_prior[i], turn * load3<float>(&target.normal_prior[i]));
}

// The root mean square distance of each body's surfels from its centre.
std::vector<double> radii_of(const Surfels& main, const Motion& motion) {
  std::vector<double> sum(static_cast<size_t>(motion.bodies())), count(sum.size());
  for (int64_t i = 0; i < main.count(); ++i) {
    const int32_t body = main.body[i];
    if (body < 0) continue;
    const Vec3<double> arm = load3<double>(main.position.row(i)) - load3<double>(motion.centre.row(body));
    sum[static_cast<size_t>(body)] += dot(arm, arm);
    count[static_cast<size_t>(body)] += 1;
  }
  for (size_t b = 0; b < sum.size(); ++b)
    sum[b] = count[b] > 0 && sum[b] > 0 ? std::sqrt(sum[b] / count[b]) : 1;
  return sum;
}

double robust_cost(const Tensor<float>& residuals) {
  return ordered_sum<double>("track: cost", residuals.size(), [&](int64_t i) {
    const double x = std::abs(static_cast<double>(residuals[i]));
    return x < huber ? x * x / (2 * huber) : x - huber / 2;
  });
}

// Adds Σ w J Jᵀ and −Σ w J r.
void add_normal_equations(const Tensor<float>& residuals, const Tensor<float>& jacobian,
                          NormalEquations& equations) {
  const size_t params = equations.b.size();
  const int64_t pixels = residuals.size() / channels;
  constexpr int64_t block = 512;
  const auto blocks = static_cast<size_t>((pixels + block - 1) / block);
  const size_t size = params * params + params;
  std::vector<std::vector<double>> partial(blocks);
  parallel_blocks("track: normal equations", pixels, block, [&](int64_t begin, int64_t end) {
    std::vector<double>& sums = partial[static_cast<size_t>(begin / block)];
    sums.assign(size, 0.0);
    std::vector<double> row(params);
    for (int64_t pixel = begin; pixel < end; ++pixel) {
      for (int64_t c = 0; c < channels; ++c) {
        const double value = residuals[pixel * channels + c];
        bool any = false;
        for (size_t p = 0; p < params; ++p) {
          row[p] = jacobian[(pixel * static_cast<int64_t>(params) + static_cast<int64_t>(p)) * channels + c];
          any = any || row[p] != 0;
        }
        if (!any) continue;
        const double weight = 1 / std::max(huber, std::abs(value));
        for (size_t p = 0; p < params; ++p) {
          const double weighted = weight * row[p];
          for (size_t q = 0; q <= p; ++q) sums[p * params + q] += weighted * row[q];
          sums[params * params + p] -= weighted * value;
        }
      }
    }
  });
  for (const std::vector<double>& sums : partial) {
    for (size_t p = 0; p < params; ++p) {
      for (size_t q = 0; q <= p; ++q) equations.a[p * params + q] += sums[p * params + q];
      equations.b[p] += sums[params * params + p];
    }
  }
}

}  // namespace

PoseSolver::PoseSolver(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key,
                       const raster::Options& options, std::vector<TrackTarget> targets)
    : main_(main),
      motion_(motion),
      key_(key),
      options_(options),
      targets_(std::move(targets)),
      params_(static_cast<size_t>(pose_size * motion.bodies())),
      radius_(radii_of(main, motion)),
      saved_(motion::make_saved()),
      pivot_({motion.bodies(), 3}),
      normal_weight_(targets_.size()),
      colour_weight_(targets_.size()),
      blended_(raster::make_saved()) {
  options_.sort = raster::SortOrder::centre;  // required by body_jacobian
  // The low-pass widens surfels by a share of a pixel, which is more than in training if pixels are larger.
  const bool is_any_shrunk =
      std::any_of(targets_.begin(), targets_.end(), [](const TrackTarget& t) { return t.is_shrunk; });
  if (is_any_shrunk) options_.low_pass = 0;
  deform::forward(main, nullptr, motion.time[key], {}, 0, field::Precision::fp32, still_, nullptr);
  if (nodes != nullptr) nodes::forward(*nodes, main.body, motion.time[key], {}, still_, *nodes::make_saved());
  // Uses the rasteriser's tint for the silhouette.
  still_.tint.resize({main.count()});
  for (int64_t i = 0; i < main.count(); ++i) still_.tint[i] = main.body[i] >= 0 ? 1.0F : 0.0F;
  pose();
}

void PoseSolver::pose() {
  posed_ = still_;
  motion::forward(motion_, main_.body, motion_.time[key_], {}, posed_, *saved_);
  for (int64_t b = 0; b < motion_.bodies(); ++b) {
    store3(pivot_.row(b), load3<float>(motion_.centre.row(b)) + load3<float>(&motion_.shift(b, key_, 0)));
  }
}

void PoseSolver::turn_priors() {
  for (TrackTarget& target : targets_) {
    if (target.normal_prior.empty() || target.prior_is_unbiased) continue;
    raster::forward(posed_, target.camera, options_, whole_, nullptr);
    turn_by_surroundings(whole_, target);
  }
}

void PoseSolver::weigh_normals(const TrackWeights& weights, Over over) {
  for (size_t k = 0; k < targets_.size(); ++k) {
    const TrackTarget& target = targets_[k];
    normal_weight_[k].reset(target.coverage.shape());
    if (!(weights.normal > 0) || target.normal_prior.empty()) continue;
    if (over == Over::bodies) raster::forward(posed_, target.camera, options_, whole_, nullptr);
    for (int64_t i = 0; i < target.mask.size(); ++i) {
      const Vec3<float> told = load3<float>(&target.normal_prior[3 * i]);
      if (target.mask[i] == 0 || !(dot(told, told) > 0)) continue;
      normal_weight_[k][i] = weights.normal * (over == Over::bodies ? whole_.tint[i] : 1.0F);
    }
  }
}

// A pixel where bodies with different weights meet gets the blended weight.
void PoseSolver::weigh_colour(const TrackWeights& weights) {
  const bool any = std::any_of(weights.colour.begin(), weights.colour.end(), [](float w) { return w > 0; });
  PosedSurfels weighted = posed_;
  for (int64_t i = 0; any && i < main_.count(); ++i) {
    const int32_t b = main_.body[i];
    weighted.tint[i] = b >= 0 ? weights.colour[static_cast<size_t>(b)] : 0.0F;
  }
  for (size_t k = 0; k < targets_.size(); ++k) {
    const TrackTarget& target = targets_[k];
    colour_weight_[k].reset(target.coverage.shape());
    if (!any || target.colour.empty()) continue;
    raster::forward(weighted, target.camera, options_, whole_, nullptr);
    for (int64_t i = 0; i < whole_.tint.size(); ++i)
      colour_weight_[k][i] = target.mask[i] != 0 ? whole_.tint[i] : 0.0F;
  }
}

void PoseSolver::weigh(const TrackWeights& weights) {
  weigh_normals(weights, Over::masks);
  weigh_colour(weights);
}

const PoseSolver::Residuals& PoseSolver::residuals_of(size_t at, const TrackWeights& weights, double sigma,
                                                      bool with_jacobian) {
  const TrackTarget& target = targets_[at];
  raster::forward(posed_, target.camera, options_, whole_, blended_.get());
  const int64_t pixels = whole_.tint.size();
  Residuals& r = residuals_;
  r.value.reset({pixels, channels});
  const bool has_colour = !target.colour.empty();
  for (int64_t i = 0; i < pixels; ++i) {
    r.value(i, 0) = weights.silhouette * (whole_.tint[i] - target.coverage[i]);
    const float by_normal = normal_weight_[at][i], by_colour = colour_weight_[at][i];
    for (int64_t k = 0; k < 3; ++k) {
      if (by_normal > 0)
        r.value(i, 1 + k) = by_normal * (whole_.normal[3 * i + k] - target.normal_prior[3 * i + k]);
      if (has_colour) r.value(i, 4 + k) = by_colour * (whole_.colour[3 * i + k] - target.colour[3 * i + k]);
    }
  }
  if (with_jacobian) {
    raster::body_jacobian(posed_, main_.body, pivot_, target.camera, options_, *blended_, r.jacobian);
    for (int64_t i = 0; i < pixels; ++i) {
      const float by_normal = normal_weight_[at][i], by_colour = colour_weight_[at][i];
      float* row = r.jacobian.data() + i * static_cast<int64_t>(params_) * channels;
      for (size_t p = 0; p < params_; ++p, row += channels) {
        row[0] *= weights.silhouette;
        for (int64_t k = 0; k < 3; ++k) {
          row[1 + k] *= by_normal;
          row[4 + k] *= by_colour;
        }
      }
    }
    gaussian_blur(r.jacobian, scratch_, target.camera.height, target.camera.width,
                  static_cast<int64_t>(params_) * channels, sigma);
  }
  gaussian_blur(r.value, scratch_, target.camera.height, target.camera.width, channels, sigma);
  return r;
}

double PoseSolver::add_targets(const TrackWeights& weights, double sigma, NormalEquations& equations) {
  double cost = 0;
  for (size_t k = 0; k < targets_.size(); ++k) {
    const Residuals& r = residuals_of(k, weights, sigma, true);
    cost += robust_cost(r.value);
    add_normal_equations(r.value, r.jacobian, equations);
  }
  return cost;
}

void PoseSolver::hold_loose(NormalEquations& equations) const {
  std::vector<double>& a = equations.a;
  for (size_t p = 0; p < params_; ++p) {
    for (size_t q = 0; q < p; ++q) a[q * params_ + p] = a[p * params_ + q];
  }
  for (size_t body = 0; body < loose_.size(); ++body) {
    const Mat3<double> keep = Mat3<double>(1) - loose_[body];
    const size_t first = pose_size * body;
    // For three numbers with a stride of `apart`.
    const auto project = [&](double* values, size_t apart) {
      const Vec3<double> kept = keep * Vec3<double>(values[0], values[apart], values[2 * apart]);
      for (size_t c = 0; c < 3; ++c) values[c * apart] = kept[static_cast<int>(c)];
    };
    for (size_t p = 0; p < params_; ++p) project(&a[first * params_ + p], params_);
    for (size_t p = 0; p < params_; ++p) project(&a[p * params_ + first], 1);
    project(&equations.b[first], 1);
  }
}

double PoseSolver::cost_of_tracks(const std::vector<bool>& decide, NormalEquations* equations) const {
  std::vector<TrackedPart> parts(radius_.size());
  for (size_t body = 0; body < parts.size(); ++body) {
    if (!decide.empty() && decide[body])
      parts[body] = {Mat3<double>(1), true};
    else if (!by_texture_.empty())
      parts[body].turns = by_texture_[body];
  }
  double cost = 0;
  for (const Reprojection& reprojection : reprojections_)
    cost += reproject(reprojection, motion_, key_, parts, equations);
  return cost;
}

double PoseSolver::cost_of_texture(const TrackWeights& weights, NormalEquations* equations) const {
  double cost = 0;
  for (const Alignment& alignment : alignments_)
    cost += align(alignment, motion_, key_, by_texture_, equations);
  return cost + cost_of_tracks(weights.tracks, equations);
}

std::vector<PoseSolver::PoseStiffness> PoseSolver::pose_stiffness(const TrackWeights& weights) {
  // Surfels are flat. The blur removes how each one shows as a round surface rotates.
  constexpr double sigma = 2;  // pixels
  weigh(weights);
  NormalEquations equations(params_);
  add_targets(weights, sigma, equations);
  std::vector<PoseStiffness> result;
  for (size_t body = 0; body < radius_.size(); ++body) {
    const auto block = [&](size_t down, size_t right) {
      Mat3<double> m;
      for (size_t p = 0; p < 3; ++p) {
        for (size_t q = 0; q < 3; ++q) {
          const size_t i = pose_size * body + down + p, j = pose_size * body + right + q;
          m[static_cast<int>(q)][static_cast<int>(p)] =
              equations.a[std::max(i, j) * params_ + std::min(i, j)];
        }
      }
      return m;
    };
    result.push_back({block(0, 0), block(0, 3), block(3, 3) + Mat3<double>(1e-9)});
  }
  return result;
}

std::vector<SymmetricEigen<3, double>> PoseSolver::turn_stiffness(const TrackWeights& weights) {
  const bool any = std::any_of(targets_.begin(), targets_.end(),
                               [](const TrackTarget& target) { return !target.normal_prior.empty(); });
  if (!any) return {};
  std::vector<SymmetricEigen<3, double>> result;
  const std::vector<PoseStiffness> stiffness = pose_stiffness(weights);
  for (size_t body = 0; body < radius_.size(); ++body) {
    double pixels = 0;
    for (const TrackTarget& target : targets_) {
      const Vec3<double> away =
          load3<double>(pivot_.row(static_cast<int64_t>(body))) - Vec3<double>(target.camera.position);
      pixels += pi * std::pow(target.camera.focal_x * radius_[body] / glm::length(away), 2);
    }
    const auto& [turn, both, shift] = stiffness[body];
    result.push_back(symmetric_eigen((turn - both * inverse(shift) * transpose(both)) / pixels));
  }
  return result;
}

std::vector<Vec3<double>> PoseSolver::turn_centres(const TrackWeights& weights) {
  std::vector<Vec3<double>> result;
  const std::vector<PoseStiffness> stiffness = pose_stiffness(weights);
  for (size_t body = 0; body < stiffness.size(); ++body) {
    // About a point d from the pivot, translations and rotations are coupled by A_sω + A_ss [d]×.
    const auto& [turn, both, shift] = stiffness[body];
    Mat3<double> a(0);
    Vec3<double> b(0);
    for (int axis = 0; axis < 3; ++axis) {
      Vec3<double> e(0);
      e[axis] = 1;
      const Mat3<double> cross_e(cross(e, Vec3<double>(1, 0, 0)), cross(e, Vec3<double>(0, 1, 0)),
                                 cross(e, Vec3<double>(0, 0, 1)));
      a += transpose(cross_e) * shift * cross_e;
      b -= cross(e, transpose(both)[axis]);
    }
    const double most = radius_[body];
    Vec3<double> d = inverse(a) * b;
    d *= most / std::max(most, length(d));
    result.push_back(load3<double>(pivot_.row(static_cast<int64_t>(body))) + d);
  }
  return result;
}

std::vector<double> PoseSolver::step(const TrackWeights& weights, double sigma, bool depth_is_held,
                                     double& cost) {
  NormalEquations equations(params_);
  cost = add_targets(weights, sigma, equations);
  hold_loose(equations);
  cost += cost_of_texture(weights, &equations);
  return solved(std::move(equations), least_damping, depth_is_held);
}

std::vector<double> PoseSolver::solved(NormalEquations equations, double damping, bool depth_is_held) const {
  auto& [a, b] = equations;
  // Translations in radii, so that both kinds of numbers have the same scale.
  const auto unit = [&](size_t p) { return p % pose_size < 3 ? 1.0 : radius_[p / pose_size]; };
  for (size_t p = 0; p < params_; ++p) {
    for (size_t q = 0; q <= p; ++q) {
      a[p * params_ + q] *= unit(p) * unit(q);
      a[q * params_ + p] = a[p * params_ + q];
    }
    b[p] *= unit(p);
  }
  for (size_t p = 0; p < params_; ++p) a[p * params_ + p] += relative_damping * a[p * params_ + p] + damping;
  if (depth_is_held && targets_.size() == 1) hold_depth(a);
  std::vector<double> found = solve_symmetric(a, b);
  for (size_t p = 0; p < params_; ++p) {
    const double most = p % pose_size < 3 ? most_turn : most_shift;
    found[p] = std::clamp(found[p], -most, most) * unit(p);
  }
  return found;
}

void PoseSolver::hold_depth(std::vector<double>& matrix) const {
  constexpr double stiffness = 1e3;  // relative to that of the images
  const Vec3<double> eye(targets_[0].camera.position);
  for (size_t body = 0; body < radius_.size(); ++body) {
    const Vec3<double> ray = normalize(load3<double>(pivot_.row(static_cast<int64_t>(body))) - eye);
    const size_t shift = pose_size * body + 3;
    const auto at = [&](size_t p, size_t q) -> double& { return matrix[(shift + p) * params_ + shift + q]; };
    const double weight = stiffness * (at(0, 0) + at(1, 1) + at(2, 2));
    for (size_t p = 0; p < 3; ++p) {
      for (size_t q = 0; q < 3; ++q) at(p, q) += weight * ray[static_cast<int>(p)] * ray[static_cast<int>(q)];
    }
  }
}

// Rotates (from the left) and translates each body, by ω and s.
void PoseSolver::take(const std::vector<double>& step) {
  for (int64_t b = 0; b < motion_.bodies(); ++b) {
    const double* const d = step.data() + pose_size * b;
    float* const q = &motion_.rotation(b, key_, 0);
    const Vec4<double> turned =
        quaternion_product(quaternion_exp(Vec3<double>(d[0], d[1], d[2])), unit_quaternion(load4<double>(q)));
    for (int c = 0; c < 4; ++c) q[c] = static_cast<float>(turned[c]);
    add3(&motion_.shift(b, key_, 0), Vec3<double>(d[3], d[4], d[5]));
  }
  pose();
}

void PoseSolver::solve(const TrackWeights& weights, const PoseSteps& steps) {
  if (targets_.empty()) return;
  weigh_colour(weights);
  for (int k = 0; k < steps.count; ++k) {
    const double sigma = steps.blur * std::pow(blur_falls, k);
    weigh_normals(weights, Over::bodies);
    double before = 0;
    std::vector<double> found = step(weights, sigma, steps.hold_depth, before);
    const Tensor<float> rotation = motion_.rotation, shift = motion_.shift;
    bool better = false;
    for (int attempt = 0; attempt < tries && !better; ++attempt) {
      take(found);
      double after = cost_of_texture(weights, nullptr);
      for (size_t at = 0; at < targets_.size(); ++at)
        after += robust_cost(residuals_of(at, weights, sigma, false).value);
      better = after < before;
      if (better) break;
      motion_.rotation = rotation;
      motion_.shift = shift;
      for (double& number : found) number *= shorter;
    }
    if (!better) pose();
  }
}

double PoseSolver::cost(const TrackWeights& weights) {
  constexpr double sigma = 1;  // pixels
  weigh(weights);
  double sum = 0;
  for (size_t at = 0; at < targets_.size(); ++at)
    sum += robust_cost(residuals_of(at, weights, sigma, false).value);
  return sum;
}

template <class F>
std::vector<Vec3<double>> PoseSolver::turns_of_steps(F&& next) {
  constexpr int steps = 3;
  const Tensor<float> rotation = motion_.rotation, shift = motion_.shift;
  for (int k = 0; k < steps; ++k) {
    constexpr double damping = 1;  // holds what the residuals do not determine
    take(solved(next(), damping, false));
  }
  std::vector<Vec3<double>> turns;
  for (int64_t b = 0; b < motion_.bodies(); ++b) {
    const Vec4<double> from = unit_quaternion(load4<double>(&rotation(b, key_, 0)));
    const Vec4<double> to = unit_quaternion(load4<double>(&motion_.rotation(b, key_, 0)));
    turns.push_back(quaternion_log(quaternion_product(to, quaternion_conjugate(from))));
  }
  motion_.rotation = rotation;
  motion_.shift = shift;
  pose();
  return turns;
}

std::vector<Vec3<double>> PoseSolver::turns_by_colour() {
  constexpr double sigma = 1;  // pixels
  const TrackWeights colour{0, 0, std::vector<float>(radius_.size(), 1.0F), {}};
  weigh(colour);
  return turns_of_steps([&] {
    NormalEquations equations(params_);
    add_targets(colour, sigma, equations);
    hold_loose(equations);
    return equations;
  });
}

std::vector<Vec3<double>> PoseSolver::turns_by_tracks() {
  return turns_of_steps([&] {
    NormalEquations equations(params_);
    cost_of_tracks(std::vector<bool>(radius_.size(), true), &equations);
    return equations;
  });
}

}  // namespace traceflow
