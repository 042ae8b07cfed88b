#include "train/photo_alignment.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "train/gaussian_blur.h"

namespace traceflow {

namespace {

// Detail is what is finer than so many pixels. Coarser patterns are shading, which stays where it is when a
// body turns: at four pixels a quarter of each turn was lost on a small ball.
constexpr double detail_sigma = 2;
constexpr double widest_detail = 3;  // times the blur, where photographs are blurred
// The weight of a difference of colours, and where the cost of one becomes linear.
constexpr double weight = 1.5, huber_width = 0.05;
constexpr float least_cosine = 0.3F;  // between a surface and the ray to it
constexpr int64_t most_samples = 2000;

bool faces(const Vec3<double>& normal, const Vec3<double>& ray) {
  return -dot(normal, ray) > least_cosine * length(ray);
}

// Turns an image (H×W×channels) into its mean within a few pixels, over what the mask covers: what is beside
// a body does not move with it.
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

}  // namespace

std::optional<Looked> look(const DetailPhoto& photo, double x, double y) {
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
  return Looked{(1 - down) * top + down * bottom,
                (1 - down) * (at(0, 1) - at(0, 0)) + down * (at(1, 1) - at(1, 0)), bottom - top};
}

DetailPhoto detail_of(FinePhotograph photograph, double blur) {
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
      // The drawn pixel's plane, where the finer pixel's ray meets it.
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
  const Camera<double> camera = convert<double>(alignment.photo->camera);
  const std::vector<Mat3<double>> rotation = rotations_at(motion, key);
  double cost = 0;
  for (const DetailSample& sample : alignment.samples) {
    const auto body = static_cast<size_t>(sample.rest.body);
    const Vec3<double> centre = load3<double>(motion.centre.row(sample.rest.body));
    const Vec3<double> arm = rotation[body] * (Vec3<double>(sample.rest.position) - centre);
    const Vec3<double> point = centre + arm + load3<double>(&motion.shift(sample.rest.body, key, 0));
    const Vec3<double> in_camera = camera.point_in_camera(point);
    if (!(in_camera.z > 0)) continue;
    const Vec2<double> at = camera.project(in_camera);
    const bool is_seen = faces(rotation[body] * Vec3<double>(sample.rest.normal), point - camera.position);
    const std::optional<Looked> there = is_seen ? look(*alignment.photo, at.x, at.y) : std::nullopt;
    if (!there) {
      cost += alignment.weight * huber_width / 2;  // leaving the view pays no better than a difference
      continue;
    }
    const auto [x_by, y_by] = pixel_by_point(camera, in_camera);
    for (int c = 0; c < 3; ++c) {
      const double residual = weight * (there->value[c] - static_cast<double>(sample.detail[c]));
      const double size = std::abs(residual);
      cost +=
          alignment.weight * (size < huber_width ? size * size / (2 * huber_width) : size - huber_width / 2);
      if (equations == nullptr) continue;
      const Vec3<double> by_point = weight * (there->by_x[c] * x_by + there->by_y[c] * y_by);
      const Vec3<double> by_turn = loose[body] * cross(arm, by_point);
      equations->add<3>(6 * body, {by_turn.x, by_turn.y, by_turn.z}, residual,
                        alignment.weight / std::max(huber_width, size));
    }
  }
  return cost;
}

}  // namespace traceflow
