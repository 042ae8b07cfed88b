#include "train/tracker.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "math/rotation_group.h"
#include "math/similarity_fit.h"
#include "ops/deform/deform.h"
#include "ops/motion/motion.h"
#include "ops/raster/body_picture.h"

namespace traceflow {

namespace {

constexpr int widest = 160;
constexpr int pose_size = 6;
constexpr int channels = 4;
constexpr double huber = 0.05;
constexpr double blur_falls = 0.7;
// A step turns a body by at most so many radians and shifts it by so many of its radii.
constexpr double most_turn = 0.1, most_shift = 0.15;
constexpr double relative_damping = 1e-3, damping = 1e-3;
constexpr int tries = 3;
constexpr double shorter = 0.4;
constexpr int keys_for_speed = 3;

// Gaussian, along both sides, the border repeated; pixels of `width` numbers. In place.
void blur(Tensor<float>& image, int64_t height, int64_t width, int64_t numbers, double sigma) {
  if (sigma < 0.3) return;
  const auto reach = static_cast<int64_t>(std::ceil(2.5 * sigma));
  std::vector<float> taps;
  float sum = 0;
  for (int64_t k = -reach; k <= reach; ++k) {
    taps.push_back(static_cast<float>(std::exp(-0.5 * static_cast<double>(k * k) / (sigma * sigma))));
    sum += taps.back();
  }
  for (float& tap : taps) tap /= sum;
  Tensor<float> along(image.shape());
  const auto pass = [&](const Tensor<float>& from, Tensor<float>& to, bool down) {
    parallel_blocks("track: blur", height, 4, [&](int64_t begin, int64_t end) {
      for (int64_t y = begin; y < end; ++y) {
        for (int64_t x = 0; x < width; ++x) {
          float* const sums = to.data() + (y * width + x) * numbers;
          std::fill_n(sums, numbers, 0.0F);
          for (int64_t k = -reach; k <= reach; ++k) {
            const int64_t row = down ? std::clamp<int64_t>(y + k, 0, height - 1) : y;
            const int64_t column = down ? x : std::clamp<int64_t>(x + k, 0, width - 1);
            const float* const values = from.data() + (row * width + column) * numbers;
            const float tap = taps[static_cast<size_t>(k + reach)];
            for (int64_t n = 0; n < numbers; ++n) sums[n] += tap * values[n];
          }
        }
      }
    });
  };
  pass(image, along, false);
  pass(along, image, true);
}

// Solves a x = b for a symmetric positive definite a (n×n), by elimination.
std::vector<double> solve_symmetric(std::vector<double> a, std::vector<double> b) {
  const size_t n = b.size();
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = i + 1; j < n; ++j) {
      const double factor = a[j * n + i] / a[i * n + i];
      for (size_t k = i; k < n; ++k) a[j * n + k] -= factor * a[i * n + k];
      b[j] -= factor * b[i];
    }
  }
  for (size_t i = n; i-- > 0;) {
    for (size_t k = i + 1; k < n; ++k) b[i] -= a[i * n + k] * b[k];
    b[i] /= a[i * n + i];
  }
  return b;
}

// Average of factor × factor pixels.
Tensor<float> smaller(const Tensor<float>& image, int64_t numbers, int64_t factor) {
  const int64_t height = image.dim(0) / factor, width = image.dim(1) / factor;
  Tensor<float> result(numbers == 1 ? Shape{height, width} : Shape{height, width, numbers});
  const float share = 1.0F / static_cast<float>(factor * factor);
  for (int64_t y = 0; y < height * factor; ++y) {
    for (int64_t x = 0; x < width * factor; ++x) {
      const float* const from = image.data() + (y * image.dim(1) + x) * numbers;
      float* const to = result.data() + (y / factor * width + x / factor) * numbers;
      for (int64_t k = 0; k < numbers; ++k) to[k] += share * from[k];
    }
  }
  return result;
}

// The rotation that takes `from` nearest to `to`, given Σ to · fromᵀ.
Mat3<double> rotation_of_moments(const Mat3<double>& moments) {
  std::array<Vec3<double>, 6> from, to;
  // Axes and their opposites: as points about the origin they have these moments.
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<size_t>(axis);
    Vec3<double> unit(0);
    unit[axis] = 1;
    from[2 * k] = unit;
    from[2 * k + 1] = -unit;
    to[2 * k] = moments[axis];
    to[2 * k + 1] = -moments[axis];
  }
  return fit_similarity(from, to).rotation;
}

// Turns a view's priors, in the camera's axes, so that those of what stands still agree with the model.
void turn_priors(const raster::Output& picture, const Camera<float>& camera, const Tensor<uint8_t>& mask,
                 Tensor<float>& prior) {
  constexpr double pull = 0.05;  // towards none
  constexpr int rounds = 6;
  constexpr int64_t least_pixels = 50;
  const Mat3<double> to_camera(camera.camera_from_world);
  Mat3<double> bias(1);
  for (int round = 0; round < rounds; ++round) {
    const double within = std::cos((round == 0 ? 25 : 15) * 0.017453292519943295);
    Mat3<double> moments(0);
    int64_t count = 0;
    for (int64_t i = 0; i < picture.alpha.size(); ++i) {
      if (picture.alpha[i] < 0.9F || (!mask.empty() && mask[i] != 0)) continue;
      const Vec3<double> model = load3<double>(picture.normal.data() + 3 * i);
      const Vec3<double> told = load3<double>(prior.data() + 3 * i);
      if (dot(model, model) < 0.25 || dot(told, told) < 0.25) continue;
      const Vec3<double> a = to_camera * normalize(model), b = to_camera * normalize(told);
      if (!(dot(bias * a, b) > within)) continue;
      moments += outerProduct(b, a);
      ++count;
    }
    if (count < least_pixels) return;
    bias = rotation_of_moments(moments + pull * static_cast<double>(count) * bias);
  }
  const Mat3<float> turn(transpose(to_camera) * transpose(bias) * to_camera);
  for (int64_t i = 0; i < prior.size(); i += 3) store3(&prior[i], turn * load3<float>(&prior[i]));
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

}  // namespace

Tracker::Tracker(const TrackOptions& options, const RenderOptions& render, const Capture& capture)
    : options_(options), render_(render), capture_(capture) {}

void Tracker::predict(Motion& motion, int64_t key) {
  if (key == 0) return;
  const int64_t last = key - 1, first = std::max<int64_t>(0, last - keys_for_speed);
  const double span = static_cast<double>(motion.time[last]) - motion.time[first];
  const double share = span > 0 ? (motion.time[key] - static_cast<double>(motion.time[last])) / span : 0;
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    const Vec4<double> from = unit_quaternion(load4<double>(&motion.rotation(b, first, 0)));
    const Vec4<double> to = unit_quaternion(load4<double>(&motion.rotation(b, last, 0)));
    const Vec3<double> turn = quaternion_log(quaternion_product(to, quaternion_conjugate(from)));
    const Vec4<double> rotation = quaternion_product(quaternion_exp(share * turn), to);
    const Vec3<double> a = load3<double>(&motion.shift(b, first, 0)),
                       z = load3<double>(&motion.shift(b, last, 0));
    for (int64_t k = key; k < motion.keys(); ++k) {
      for (int c = 0; c < 4; ++c) motion.rotation(b, k, c) = static_cast<float>(rotation[c]);
      store3(&motion.shift(b, k, 0), z + share * (z - a));
    }
  }
}

Tracker::Target Tracker::target_of(const View& view) const {
  const std::shared_ptr<const ViewImages> images = load_images(capture_, view);
  const int64_t factor = (view.camera.width + widest - 1) / widest;
  Target target;
  target.camera = view.camera;
  if (images->coverage.empty()) return target;
  target.is_shrunk = factor > 1;
  const auto shrunk = static_cast<float>(factor);
  target.camera.width = view.camera.width / static_cast<int>(factor);
  target.camera.height = view.camera.height / static_cast<int>(factor);
  for (float* length :
       {&target.camera.focal_x, &target.camera.focal_y, &target.camera.centre_x, &target.camera.centre_y})
    *length /= shrunk;
  target.coverage = smaller(images->coverage, 1, factor);
  target.mask.resize(target.coverage.shape());
  for (int64_t i = 0; i < target.mask.size(); ++i) target.mask[i] = target.coverage[i] >= 0.5F ? 1 : 0;
  if (images->normal_prior.empty()) return target;
  target.normal_prior = smaller(images->normal_prior, 3, factor);
  for (int64_t i = 0; i < target.normal_prior.size(); i += 3) {
    const Vec3<float> n = load3<float>(&target.normal_prior[i]);
    const float length = glm::length(n);
    store3(&target.normal_prior[i], length > 0.5F ? n / length : Vec3<float>(0));
  }
  return target;
}

namespace {

// One view's residuals and how they change.
struct Residuals {
  Tensor<float> value;     // n×4
  Tensor<float> jacobian;  // n×P×4; empty where not asked for
};

double robust_cost(const Tensor<float>& residuals) {
  return ordered_sum<double>("track: cost", residuals.size(), [&](int64_t i) {
    const double x = std::abs(static_cast<double>(residuals[i]));
    return x < huber ? x * x / (2 * huber) : x - huber / 2;
  });
}

// Adds Σ w J Jᵀ and −Σ w J r.
void add_normal_equations(const Residuals& r, size_t params, std::vector<double>& a, std::vector<double>& b) {
  const int64_t pixels = r.value.size() / channels;
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
        const double value = r.value[pixel * channels + c];
        bool any = false;
        for (size_t p = 0; p < params; ++p) {
          row[p] =
              r.jacobian[(pixel * static_cast<int64_t>(params) + static_cast<int64_t>(p)) * channels + c];
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
      for (size_t q = 0; q <= p; ++q) a[p * params + q] += sums[p * params + q];
      b[p] += sums[params * params + p];
    }
  }
}

// Turns and shifts the bodies at one key: by ω (left) and s for each.
void step_key(Motion& motion, int64_t key, const std::vector<double>& step) {
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    const double* const d = step.data() + pose_size * b;
    float* const q = &motion.rotation(b, key, 0);
    const Vec4<double> turned =
        quaternion_product(quaternion_exp(Vec3<double>(d[0], d[1], d[2])), unit_quaternion(load4<double>(q)));
    for (int c = 0; c < 4; ++c) q[c] = static_cast<float>(turned[c]);
    add3(&motion.shift(b, key, 0), Vec3<double>(d[3], d[4], d[5]));
  }
}

}  // namespace

void Tracker::solve(const Surfels& main, Motion& motion, int64_t key, float extent, int steps,
                    double first_blur) const {
  const float time = motion.time[key];
  std::vector<Target> targets;
  for (const View& view : capture_.train) {
    if (view.time != time) continue;
    Target target = target_of(view);
    if (!target.coverage.empty()) targets.push_back(std::move(target));
  }
  if (targets.empty()) return;

  PosedSurfels still, posed;
  deform::forward(main, nullptr, time, {}, 0, field::Precision::fp32, still, nullptr);
  // The rasteriser's tint is then the silhouette.
  still.tint.resize({main.count()});
  for (int64_t i = 0; i < main.count(); ++i) still.tint[i] = main.body[i] >= 0 ? 1.0F : 0.0F;
  const motion::SavedPtr saved = motion::make_saved();
  raster::Options drawn = render_.raster_options(extent);
  drawn.sort = raster::SortOrder::centre;  // as draw_bodies
  // The low-pass widens surfels by a share of a pixel: by more than in training where pixels are larger.
  drawn.low_pass = drawn.low_pass && !std::any_of(targets.begin(), targets.end(),
                                                  [](const Target& target) { return target.is_shrunk; });
  const auto params = static_cast<size_t>(pose_size * motion.bodies());
  const std::vector<double> radius = radii_of(main, motion);
  Tensor<float> pivot({motion.bodies(), 3});
  raster::BodyPicture picture;
  raster::Output whole;
  const auto pose = [&] {
    posed = still;
    motion::forward(motion, main.body, time, {}, posed, *saved);
    for (int64_t b = 0; b < motion.bodies(); ++b) {
      store3(pivot.row(b), load3<float>(motion.centre.row(b)) + load3<float>(&motion.shift(b, key, 0)));
    }
  };
  const auto look = [&](const Target& target, double sigma, bool with_jacobian) {
    raster::forward(posed, target.camera, drawn, whole, nullptr);
    const int64_t pixels = whole.tint.size();
    Residuals r{Tensor<float>({pixels, channels}), {}};
    const auto silhouette = options_.silhouette, normal = options_.normal;
    const bool has_prior = !target.normal_prior.empty();
    const auto counts = [&](int64_t i) {
      return has_prior && target.mask[i] != 0 &&
             dot(load3<float>(&target.normal_prior[3 * i]), load3<float>(&target.normal_prior[3 * i])) > 0;
    };
    for (int64_t i = 0; i < pixels; ++i) {
      r.value(i, 0) = silhouette * (whole.tint[i] - target.coverage[i]);
      if (!counts(i)) continue;
      for (int64_t k = 0; k < 3; ++k)
        r.value(i, 1 + k) = normal * (whole.normal[3 * i + k] - target.normal_prior[3 * i + k]);
    }
    if (with_jacobian) {
      raster::draw_bodies(posed, main.body, pivot, target.camera, drawn, picture);
      r.jacobian.swap(picture.jacobian);
      for (int64_t i = 0; i < pixels; ++i) {
        const float by_normal = counts(i) ? normal : 0;
        float* row = r.jacobian.data() + i * static_cast<int64_t>(params) * channels;
        for (size_t p = 0; p < params; ++p, row += channels) {
          row[0] *= silhouette;
          for (int64_t k = 1; k < channels; ++k) row[k] *= by_normal;
        }
      }
      blur(r.jacobian, target.camera.height, target.camera.width, static_cast<int64_t>(params) * channels,
           sigma);
    }
    blur(r.value, target.camera.height, target.camera.width, channels, sigma);
    return r;
  };

  pose();
  for (Target& target : targets) {
    if (target.normal_prior.empty()) continue;
    raster::forward(posed, target.camera, drawn, whole, nullptr);
    turn_priors(whole, target.camera, target.mask, target.normal_prior);
  }
  for (int step = 0; step < steps; ++step) {
    const double sigma = first_blur * std::pow(blur_falls, step);
    std::vector<double> a(params * params), b(params);
    double before = 0;
    for (const Target& target : targets) {
      const Residuals r = look(target, sigma, true);
      before += robust_cost(r.value);
      add_normal_equations(r, params, a, b);
    }
    // Shifts in radii, so that both kinds of numbers are of one size.
    const auto unit = [&](size_t p) { return p % pose_size < 3 ? 1.0 : radius[p / pose_size]; };
    for (size_t p = 0; p < params; ++p) {
      for (size_t q = 0; q <= p; ++q) {
        a[p * params + q] *= unit(p) * unit(q);
        a[q * params + p] = a[p * params + q];
      }
      b[p] *= unit(p);
    }
    for (size_t p = 0; p < params; ++p) a[p * params + p] += relative_damping * a[p * params + p] + damping;
    std::vector<double> found = solve_symmetric(a, b);
    for (size_t p = 0; p < params; ++p) {
      const double most = p % pose_size < 3 ? most_turn : most_shift;
      found[p] = std::clamp(found[p], -most, most) * unit(p);
    }
    const Tensor<float> rotation = motion.rotation, shift = motion.shift;
    bool better = false;
    for (int attempt = 0; attempt < tries && !better; ++attempt) {
      step_key(motion, key, found);
      pose();
      double after = 0;
      for (const Target& target : targets) after += robust_cost(look(target, sigma, false).value);
      better = after < before;
      if (better) break;
      motion.rotation = rotation;
      motion.shift = shift;
      for (double& number : found) number *= shorter;
    }
    if (!better) pose();
  }
}

}  // namespace traceflow
