#include "track/photo_alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "math/rotation.h"
#include "track/gaussian_blur.h"

namespace traceflow {

namespace {

// Detail is finer than this number of pixels. Coarser patterns are shading, which does not rotate with a
// body: at four pixels a quarter of each rotation was lost on a small ball.
constexpr double detail_sigma = 2;
constexpr double widest_detail = 3;  // times the blur, if photographs are blurred
// The weight of a colour difference, and the width of Huber's cost.
constexpr double weight = 1.5, huber_width = 0.05;
constexpr float least_cosine = 0.3F;  // between a surface and the ray to it
constexpr int64_t most_samples = 2000;

bool faces(const Vec3<double>& normal, const Vec3<double>& ray) {
  return -dot(normal, ray) > least_cosine * length(ray);
}

// Replaces an image (H×W×channels) by its blurred mean over covered pixels, because what is beside a body
// does not move with it.
void take_mean(const Tensor<float>& coverage, int64_t channels, double sigma, Tensor<float>& image) {
  constexpr float least = 1e-3F;
  const int64_t height = coverage.dim(0), width = coverage.dim(1);
  Tensor<float> share = coverage, scratch;
  for (int64_t i = 0; i < image.size(); ++i) image[i] *= coverage[i / channels];
  gaussian_blur(image, scratch, height, width, channels, sigma);
  gaussian_blur(share, scratch, height, width, 1, sigma);
  for (int64_t i = 0; i < image.size(); ++i)
    image[i] = share[i / channels] > least ? image[i] / share[i / channels] : 0.0F;
}

// Removes clipped pixels and their surroundings from a photograph's coverage. A highlight does not rotate
// with a body and is bright enough to outweigh the texture. If many pixels are clipped, the body is white and
// keeps them.
void leave_clipped_out(FinePhotograph& photograph) {
  constexpr float clipped = 0.97F;
  constexpr int64_t margin = 2;         // pixels
  constexpr double most_clipped = 0.2;  // of what the mask covers
  Tensor<float>& coverage = photograph.coverage;
  const int64_t height = coverage.dim(0), width = coverage.dim(1);
  std::vector<std::array<int64_t, 2>> bright;
  int64_t covered = 0;
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) {
      if (coverage(y, x) < 0.5F) continue;
      ++covered;
      const float* const colour = &photograph.colour(y, x, 0);
      if (std::min({colour[0], colour[1], colour[2]}) >= clipped) bright.push_back({y, x});
    }
  }
  if (static_cast<double>(bright.size()) > most_clipped * static_cast<double>(covered)) return;
  for (const auto& [y, x] : bright) {
    for (int64_t r = std::max<int64_t>(0, y - margin); r <= std::min(height - 1, y + margin); ++r) {
      for (int64_t c = std::max<int64_t>(0, x - margin); c <= std::min(width - 1, x + margin); ++c)
        coverage(r, c) = 0;
    }
  }
}

// A sample that a photograph shows: its residuals, and their derivatives by ω.
struct SeenSample {
  std::array<double, 3> residual;
  std::array<Vec3<double>, 3> by_turn;
};

std::optional<SeenSample> see(const DetailSample& sample, const Camera<double>& camera,
                              const DetailPhoto& photo, const Vec3<double>& centre, const Vec3<double>& shift,
                              const Mat3<double>& rotation) {
  const Vec3<double> arm = rotation * (Vec3<double>(sample.rest.position) - centre);
  const Vec3<double> point = centre + arm + shift, in_camera = camera.point_in_camera(point);
  if (!(in_camera.z > 0) || !faces(rotation * Vec3<double>(sample.rest.normal), point - camera.position))
    return std::nullopt;
  const Vec2<double> at = camera.project(in_camera);
  const std::optional<PhotoSample> there = sample_at(photo, at.x, at.y);
  if (!there) return std::nullopt;
  const auto [x_by, y_by] = pixel_by_point(camera, in_camera);
  SeenSample seen;
  for (int c = 0; c < 3; ++c) {
    const auto channel = static_cast<size_t>(c);
    seen.residual[channel] = weight * (there->value[c] - static_cast<double>(sample.detail[c]));
    seen.by_turn[channel] = cross(arm, weight * (there->by_x[c] * x_by + there->by_y[c] * y_by));
  }
  return seen;
}

// The cost of one body's samples. Hidden samples cost as much as visible ones, so that a rotation gains
// nothing by hiding differences.
double align_body(const Alignment& alignment, std::span<const DetailSample> samples, const Motion& motion,
                  int64_t key, const Mat3<double>& loose, NormalEquations* equations) {
  constexpr double least_seen = 0.25;  // of the samples; below it each costs 1
  const auto body = samples.front().rest.body;
  const Camera<double> camera = convert<double>(alignment.photo->camera);
  const Mat3<double> rotation = rotation_from_quaternion(load4<double>(&motion.rotation(body, key, 0)));
  const Vec3<double> centre = load3<double>(motion.centre.row(body));
  const Vec3<double> shift = load3<double>(&motion.shift(body, key, 0));
  std::vector<SeenSample> seen;
  for (const DetailSample& sample : samples) {
    if (auto now = see(sample, camera, *alignment.photo, centre, shift, rotation)) seen.push_back(*now);
  }
  const auto all = static_cast<double>(samples.size());
  if (static_cast<double>(seen.size()) < least_seen * all) return alignment.weight * all;
  const double share = alignment.weight * all / static_cast<double>(seen.size());
  double cost = 0;
  for (const SeenSample& now : seen) {
    for (size_t c = 0; c < 3; ++c) {
      const double size = std::abs(now.residual[c]);
      cost += share * (size < huber_width ? size * size / (2 * huber_width) : size - huber_width / 2);
      if (equations == nullptr) continue;
      const Vec3<double> by_turn = loose * now.by_turn[c];
      equations->add<3>(6 * static_cast<size_t>(body), {by_turn.x, by_turn.y, by_turn.z}, now.residual[c],
                        share / std::max(huber_width, size));
    }
  }
  return cost;
}

}  // namespace

std::optional<PhotoSample> sample_at(const DetailPhoto& photo, double x, double y) {
  const auto column = static_cast<int64_t>(std::floor(x - 0.5)),
             row = static_cast<int64_t>(std::floor(y - 0.5));
  if (column < 0 || row < 0 || column + 1 >= photo.camera.width || row + 1 >= photo.camera.height)
    return std::nullopt;
  for (const int64_t r : {row, row + 1}) {
    for (const int64_t c : {column, column + 1}) {
      if (photo.mask(r, c) == 0) return std::nullopt;
    }
  }
  const double right = x - 0.5 - static_cast<double>(column), down = y - 0.5 - static_cast<double>(row);
  const auto at = [&](int64_t r, int64_t c) { return load3<double>(&photo.detail(row + r, column + c, 0)); };
  const Vec3<double> top = (1 - right) * at(0, 0) + right * at(0, 1);
  const Vec3<double> bottom = (1 - right) * at(1, 0) + right * at(1, 1);
  return PhotoSample{(1 - down) * top + down * bottom,
                     (1 - down) * (at(0, 1) - at(0, 0)) + down * (at(1, 1) - at(1, 0)), bottom - top};
}

DetailPhoto detail_of(FinePhotograph photograph, double blur) {
  leave_clipped_out(photograph);
  DetailPhoto photo{photograph.camera, std::move(photograph.colour),
                    Tensor<uint8_t>(photograph.coverage.shape())};
  const Tensor<float>& coverage = photograph.coverage;
  Tensor<float> mean = photo.detail;
  take_mean(coverage, 3, blur > 0 ? widest_detail * blur : detail_sigma, mean);
  if (blur > 0) take_mean(coverage, 3, blur, photo.detail);
  for (int64_t i = 0; i < mean.size(); ++i) photo.detail[i] -= mean[i];
  for (int64_t i = 0; i < photo.mask.size(); ++i) photo.mask[i] = coverage[i] >= 0.5F ? 1 : 0;
  return photo;
}

DetailPhoto cropped(const DetailPhoto& photo) {
  const int64_t height = photo.mask.dim(0), width = photo.mask.dim(1);
  int64_t top = height, left = width, bottom = 0, right = 0;
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) {
      if (photo.mask(y, x) == 0) continue;
      top = std::min(top, y);
      left = std::min(left, x);
      bottom = std::max(bottom, y + 1);
      right = std::max(right, x + 1);
    }
  }
  if (bottom <= top) return photo;
  DetailPhoto part{photo.camera, Tensor<float>({bottom - top, right - left, 3}),
                   Tensor<uint8_t>({bottom - top, right - left})};
  part.camera.height = static_cast<int>(bottom - top);
  part.camera.width = static_cast<int>(right - left);
  part.camera.centre_x -= static_cast<float>(left);
  part.camera.centre_y -= static_cast<float>(top);
  for (int64_t y = top; y < bottom; ++y) {
    std::copy_n(&photo.detail(y, left, 0), 3 * (right - left), &part.detail(y - top, 0, 0));
    std::copy_n(&photo.mask(y, left), right - left, &part.mask(y - top, 0));
  }
  return part;
}

std::vector<DetailSample> detail_samples(const DetailPhoto& photo, const BodySurface& surface,
                                         const Motion& motion, int64_t key, const LooseTurns& loose) {
  std::vector<std::vector<DetailSample>> found(loose.size());
  const Camera<float>& drawn = surface.camera;
  const float ratio = drawn.focal_x / photo.camera.focal_x;
  const auto shrunk = [&](int64_t k, int size) {
    return std::min<int64_t>(size - 1, static_cast<int64_t>((static_cast<float>(k) + 0.5F) * ratio));
  };
  for (int64_t y = 0; y < photo.camera.height; ++y) {
    for (int64_t x = 0; x < photo.camera.width; ++x) {
      if (photo.mask(y, x) == 0) continue;
      const int64_t at = shrunk(y, drawn.height) * drawn.width + shrunk(x, drawn.width);
      SurfacePoint point = surface.points[static_cast<size_t>(at)];
      if (point.body < 0 || loose[static_cast<size_t>(point.body)] == Mat3<double>(0)) continue;
      const Vec3<float> ray =
          photo.camera.ray_in_world(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
      if (!faces(Vec3<double>(point.normal), Vec3<double>(ray))) continue;
      // The intersection of the finer pixel's ray with the plane of the rendered pixel.
      const float away = dot(point.normal, point.position - photo.camera.position) / dot(point.normal, ray);
      point.position = photo.camera.position + away * ray;
      found[static_cast<size_t>(point.body)].push_back(
          {at_rest(point, motion, key), load3<float>(&photo.detail(y, x, 0))});
    }
  }
  std::vector<DetailSample> samples;
  for (const std::vector<DetailSample>& of_body : found) {
    const size_t every = (of_body.size() + most_samples - 1) / most_samples;
    for (size_t i = 0; i < of_body.size(); i += every) samples.push_back(of_body[i]);
  }
  return samples;
}

double align(const Alignment& alignment, const Motion& motion, int64_t key, const LooseTurns& loose,
             NormalEquations* equations) {
  double cost = 0;
  for (size_t first = 0; first < alignment.samples.size();) {
    const int32_t body = alignment.samples[first].rest.body;
    size_t last = first;
    while (last < alignment.samples.size() && alignment.samples[last].rest.body == body) ++last;
    const std::span<const DetailSample> samples(&alignment.samples[first], last - first);
    cost += align_body(alignment, samples, motion, key, loose[static_cast<size_t>(body)], equations);
    first = last;
  }
  return cost;
}

}  // namespace traceflow
