#pragma once

#include <cmath>

#include "base/random.h"
#include "viz/subject.h"

namespace traceflow::viz {

inline Surfels random_surfels(int64_t n, double size, bool tint, Random& random) {
  Surfels s{Tensor<float>(Shape{n, 3}), Tensor<float>(Shape{n, 2}),    Tensor<float>(Shape{n, 4}),
            Tensor<float>(Shape{n}),    Tensor<float>(Shape{n, 4, 3}), Tensor<float>()};
  if (tint) s.tint_logit = Tensor<float>(Shape{n});
  s.for_each([&](const std::string&, Tensor<float>& t) {
    for (float& v : t.values()) v = static_cast<float>(0.5 * random.normal());
  });
  for (float& v : s.position.values()) v *= static_cast<float>(size);
  for (float& v : s.log_scale.values()) v += static_cast<float>(std::log(0.15 * size));
  for (float& v : s.opacity_logit.values()) v += 1;
  return s;
}

inline Field random_field(int outputs, Random& random) {
  NetworkOptions shape;
  shape.depth = 2;
  shape.width = 16;
  shape.skip = 0;
  shape.position_frequencies = 2;
  shape.time_frequencies = 2;
  Field field = make_field(shape, outputs, random);
  for (float& v : field.head_weight.values()) v = static_cast<float>(0.1 * random.normal());
  return field;
}

// A moving scene with everything in it, in a capture whose coordinates are not the scene's.
inline Subject moving_subject() {
  Random random(11);
  Subject subject;
  Scene& scene = subject.scene;
  scene.main = random_surfels(60, 1, true, random);
  scene.environment = random_surfels(200, 4, false, random);
  scene.main_field = random_field(residual::main_outputs, random);
  scene.environment_field = random_field(residual::environment_outputs, random);
  scene.normalisation = {{10, -20, 5}, 0.125};
  scene.extent = 3;
  scene.focal = 80;  // twice the camera's, so that its pictures have several samples
  subject.render.raster.background = {0.25F, 0.5F, 0.75F};
  subject.render.depth_ratio = 0.5F;
  return subject;
}

inline Camera<float> camera_in_scene() {
  Camera<float> camera;
  camera.width = 48;
  camera.height = 36;
  camera.focal_x = camera.focal_y = 40;
  camera.centre_x = 24;
  camera.centre_y = 18;
  camera.position = {0.25F, 0.125F, -3};
  return camera;
}

}  // namespace traceflow::viz
