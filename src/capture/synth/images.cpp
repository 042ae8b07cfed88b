#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/parallel.h"
#include "base/random.h"
#include "capture/synth/scenes.h"
#include "capture/synth/synth.h"
#include "capture/synth/trace.h"

namespace traceflow {

namespace {

using synth::Vector;

constexpr double focal_per_width = 17.0 / 18.0;
constexpr double point_noise = 0.002;

Camera<double> look_at(const SynthOptions& options, const Vector& position, const Vector& target) {
  Camera<double> camera;
  camera.width = options.width;
  camera.height = options.height;
  camera.focal_x = camera.focal_y = focal_per_width * options.width;
  camera.centre_x = 0.5 * options.width;
  camera.centre_y = 0.5 * options.height;
  camera.position = position;
  const Vector forward = normalize(target - position);
  const Vector right = normalize(cross(forward, Vector(0, 0, 1)));
  camera.camera_from_world = glm::transpose(Mat3<double>(right, cross(forward, right), forward));
  return camera;
}

Camera<double> camera_on_arc(const SynthOptions& options, const synth::CameraArc& arc, double time,
                             bool is_test) {
  const double phase = 2 * std::numbers::pi * time;
  const double azimuth = -arc.half_angle * std::cos(phase) + (is_test ? arc.test_azimuth : 0.0);
  const double elevation = arc.elevation + arc.elevation_swing * std::sin(2 * phase);
  const Vector outward(std::cos(elevation) * std::sin(azimuth), -std::cos(elevation) * std::cos(azimuth),
                       std::sin(elevation));
  return look_at(options, arc.target + arc.distance * outward, arc.target);
}

synth::Ray camera_ray(const Camera<double>& camera, double x, double y) {
  return {camera.position, normalize(camera.ray_in_world(x, y))};
}

SynthImages empty_images(const SynthOptions& options) {
  const Shape colour{options.height, options.width, 3};
  const Shape grey{options.height, options.width};
  SynthImages images;
  images.colour.reset(colour);
  images.diffuse.reset(colour);
  images.specular.reset(colour);
  images.mask.reset(grey);
  images.normal.reset(colour);
  images.depth.reset(grey);
  return images;
}

// Stores mask, normal and depth at the pixel's centre.
void record_geometry(const synth::Stage& stage, const Camera<double>& camera, int64_t row, int64_t column,
                     SynthImages& images) {
  const synth::Ray ray =
      camera_ray(camera, static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
  const auto hit = synth::nearest_hit(stage, ray);
  if (!hit) return;
  images.mask(row, column) = stage.bodies[static_cast<size_t>(hit->body)].is_masked ? 1 : 0;
  store3(&images.normal(row, column, 0), hit->normal);
  images.depth(row, column) = static_cast<float>(camera.point_in_camera(hit->point).z);
}

void record_light(const synth::Stage& stage, const Camera<double>& camera, int64_t row, int64_t column,
                  uint64_t key, int samples, SynthImages& images) {
  synth::Radiance sum;
  for (int sample = 0; sample < samples; ++sample) {
    synth::Sampler sampler(key, static_cast<uint32_t>(sample), static_cast<uint32_t>(samples));
    const Vec2<double> place = sampler.next();
    const synth::Radiance seen = synth::trace_path(
        stage, camera_ray(camera, static_cast<double>(column) + place.x, static_cast<double>(row) + place.y),
        sampler);
    sum.diffuse += seen.diffuse;
    sum.specular += seen.specular;
  }
  const double share = 1.0 / samples;
  store3(&images.diffuse(row, column, 0), glm::min(share * sum.diffuse, Vector(1)));
  store3(&images.specular(row, column, 0), glm::min(share * sum.specular, Vector(1)));
  store3(&images.colour(row, column, 0), glm::min(share * (sum.diffuse + sum.specular), Vector(1)));
}

uint64_t view_key(const SynthOptions& options, const SynthView& view) {
  const uint64_t key =
      synth::combine_bits(static_cast<uint64_t>(options.seed), static_cast<uint64_t>(view.frame));
  return synth::combine_bits(key, view.is_test ? 1 : 0);
}

}  // namespace

void SynthOptions::validate() const {
  check_option(frames >= 1 && frames <= 100000, "frames", frames, "1 to 100000");
  check_option(width >= 8 && width <= 8192, "width", width, "8 to 8192 pixels");
  check_option(height >= 8 && height <= 8192, "height", height, "8 to 8192 pixels");
  check_option(samples >= 1 && samples <= 65536, "samples", samples, "1 to 65536");
  check_option(test_every >= 1, "test_every", test_every, "at least 1");
  check_option(prior_noise >= 0 && prior_noise <= 10, "prior_noise", prior_noise, "0 to 10");
  check_option(points >= 0 && points <= 10000000, "points", points, "0 to 10000000");
}

std::vector<SynthView> synth_views(const SynthOptions& options) {
  const synth::CameraArc arc = synth::make_scene(options.scene).arc;
  std::vector<SynthView> views;
  for (int frame = 0; frame < options.frames; ++frame) {
    const double time = options.frames > 1 ? static_cast<double>(frame) / (options.frames - 1) : 0.0;
    const bool has_test = frame % options.test_every == options.test_every / 2;
    views.push_back(
        {fmt::format("{:06}_left", frame), frame, time, false, camera_on_arc(options, arc, time, false)});
    if (!has_test) continue;
    views.push_back(
        {fmt::format("{:06}_right", frame), frame, time, true, camera_on_arc(options, arc, time, true)});
  }
  return views;
}

SynthImages synth_images(const SynthOptions& options, const SynthView& view) {
  const synth::Stage stage = synth::make_scene(options.scene).at(view.time);
  const uint64_t key = view_key(options, view);
  SynthImages images = empty_images(options);
  parallel_for(
      "synthesise rows", options.height,
      [&](int64_t row) {
        for (int64_t column = 0; column < options.width; ++column) {
          const auto pixel = static_cast<uint64_t>(row * options.width + column);
          record_geometry(stage, view.camera, row, column, images);
          record_light(stage, view.camera, row, column, synth::combine_bits(key, pixel), options.samples,
                       images);
        }
      },
      1);
  return images;
}

Tensor<float> synth_points(const SynthOptions& options) {
  const synth::Stage stage = synth::make_scene(options.scene).at(0);
  std::vector<SynthView> views = synth_views(options);
  std::erase_if(views, [](const SynthView& view) { return view.is_test; });
  Random random(synth::combine_bits(static_cast<uint64_t>(options.seed), 0x706F696E7473));
  Tensor<float> points({options.points, 3});
  for (int i = 0; i < options.points; ++i) {
    const Camera<double>& camera = views[static_cast<size_t>(random.below(options.frames))].camera;
    const double x = random.uniform(0, options.width);
    const double y = random.uniform(0, options.height);
    const auto hit = synth::nearest_hit(stage, camera_ray(camera, x, y));
    require(hit.has_value(), "a synthetic room is closed");
    Vector noise(0);
    for (int axis = 0; axis < 3; ++axis) noise[axis] = point_noise * random.normal();
    store3(points.row(i), hit->point + noise);
  }
  return points;
}

SceneNormalisation synth_normalisation() { return {Vector(0, 0, 0.3), 0.5}; }

}  // namespace traceflow
