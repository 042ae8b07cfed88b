#pragma once

#include <optional>

#include "math/camera.h"
#include "ops/loss/loss.h"
#include "render/frame.h"
#include "scene/environment_map.h"

// The whole method's graph in double precision, composed of the ops' references: scene → loss, and its
// gradient. What the renderer's analytic gradients are held against.
namespace traceflow::reference {

// Everything that has a gradient, in one value that can be moved along a direction.
struct Parameters {
  BasicSurfels<double> main, environment;
  BasicField<double> main_field, environment_field;
  // In the place of the environment surfels where it has a field, else behind them.
  std::optional<BasicEnvironmentMap<double>> map;
  Camera<double> camera;
};

struct Gradient {
  BasicSurfels<double> main, environment;
  BasicField<double> main_field, environment_field;
  BasicEnvironmentMap<double> map;
  CameraGradient<double> camera;
};

struct Weights {
  double l1 = 0.8, ssim = 0.2, normal = 0.3, normal_prior = 0.3, depth_prior = 0.4, distortion = 0.5;
};

// What stays still while parameters move.
struct Setting {
  raster::Options raster;
  trace::Options trace;
  int samples = 1;  // along each side of a pixel
  double depth_ratio = 0.3;
  double time = 0.4;
  int sh_degree = 2;
  bool deform = true;
  bool specular = true;
  Weights weights;
  Tensor<double> target, prior;  // H×W×3
  Tensor<double> depth_prior;    // H×W
  // Where the fields are evaluated: their inputs enter detached (method §1.2), so central differences hold
  // them still.
  Tensor<double> main_points, environment_points, map_directions;
};

// The loss; its gradient too unless `gradient` is null.
double loss(const Parameters& parameters, const Setting& setting, Gradient* gradient);

// The reflection directions of all pixels, to fill Setting::map_directions.
Tensor<double> reflection_directions(const Parameters& parameters, const Setting& setting);

}  // namespace traceflow::reference
