#pragma once

#include <cmath>

#include "base/random.h"
#include "render/renderer.h"

namespace traceflow {

inline Surfels scattered(int64_t count, float spread, bool tint, Random& random) {
  Surfels s;
  s.position.reset({count, 3});
  s.log_scale.reset({count, 2});
  s.log_scale.fill(std::log(0.08F));
  s.rotation.reset({count, 4});
  s.opacity_logit.reset({count});
  s.sh.reset({count, 4, 3});
  if (tint) s.tint_logit.reset({count});
  for (float& v : s.position.values()) v = spread * static_cast<float>(random.normal());
  for (float& v : s.rotation.values()) v = static_cast<float>(random.normal());
  for (float& v : s.sh.values()) v = 0.3F * static_cast<float>(random.normal());
  return s;
}

// A cloud around the camera's target with an environment around everything; half of the cloud lies outside
// the view.
struct Fixture {
  Scene scene;
  FrameRequest request;

  Fixture() {
    Random random(3);
    scene.main = scattered(600, 1.2F, true, random);
    scene.environment = scattered(400, 3, false, random);
    NetworkOptions network;
    network.width = 16;
    network.depth = 2;
    network.skip = 0;
    scene.main_field = make_field(network, residual::main_outputs, random);
    for (float& v : scene.main_field->head_weight.values()) v = 0.05F * static_cast<float>(random.normal());
    request.camera.width = 64;
    request.camera.height = 48;
    request.camera.focal_x = request.camera.focal_y = 70;
    request.camera.centre_x = 32;
    request.camera.centre_y = 24;
    request.camera.position = {0, 0, -3};
    request.time = 0.6F;
    request.sh_degree_main = request.sh_degree_environment = 1;
  }
};

}  // namespace traceflow
