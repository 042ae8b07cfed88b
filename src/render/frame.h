#pragma once

#include <vector>

#include "math/camera.h"
#include "ops/raster/raster.h"
#include "ops/surface/surface.h"
#include "ops/trace/trace.h"
#include "scene/scene.h"

namespace traceflow {

// One picture to make.
struct FrameRequest {
  Camera<float> camera;
  float time = 0;
  int sh_degree_main = 3;
  int sh_degree_environment = 3;
  bool deform_main = true;         // evaluate the main set's field, where the scene has one (method §7.1)
  bool deform_environment = true;  // likewise the environment's
  bool specular = true;            // trace reflections, where the scene has them (method §7.2)
  bool pseudo_normals = false;     // compute N_d, which only the losses need
  bool silhouette = false;         // draw where bodies cover the picture, which only the losses need
  bool probes = false;             // training: trace a random share of the other pixels too (method §4.4)
  uint64_t probe_seed = 0;
  // Skip main surfels that lie outside the view by more than the scene's main_max_displacement. Training
  // does; a picture does not need to.
  bool cull = false;
  // Most samples along a pixel's side. Fewer than the photographs had (render/samples.h) are faster, and
  // small surfels look larger.
  int most_samples = 4;
  // The scene and the renderer's options are, unchanged, those of the last forward(), which nothing checks:
  // what is posed already as asked for here, and the tracer's BVH, are used again. The same picture, sooner.
  // Culling and a forward() for a backward() pose anew.
  bool reuse_pose = false;
};

// The rays that the traced pixels see mirrored, and what these meet.
struct MirroredRays {
  trace::Rays rays;               // P
  Tensor<float> alpha, distance;  // P, as trace::Output has them; empty with an environment map
};

// A picture with all its layers, on the device of the scene that it shows.
struct Frame {
  Camera<float> camera;         // what it is seen by
  raster::Options drawn_with;   // how it was rasterised
  PosedSurfels main;            // what was rasterised
  Tensor<int32_t> subset;       // which stored main surfels these are; empty means all
  PosedSurfels environment;     // what was traced
  raster::Output raster;        // the rasterised layers; the silhouette when asked for
  Tensor<float> pseudo_normal;  // H×W×3 when asked for
  int samples = 1;              // along each side of a pixel (method §3.6)
  // Pixels of the picture of the samples, which has so many times the rows and columns.
  surface::TracedPixels traced;
  MirroredRays mirrored;
  Tensor<float> specular_rays;     // P×3, the traced pixels' specular colours
  Tensor<float> colour;            // H×W×3, the final image (method §6)
  Tensor<float> max_displacement;  // one number: the largest distance by which the field moved a surfel of it

  // The specular colours as an image on the CPU: H×W×3, means over the traced samples, black where none was.
  Tensor<float> specular_image() const;
};

// dL/d(layers of a frame), an empty tensor meaning zero.
struct FrameGradient {
  Tensor<float> colour;                 // H×W×3
  Tensor<float> normal;                 // H×W×3
  Tensor<float> pseudo_normal;          // H×W×3
  Tensor<float> distortion;             // H×W
  Tensor<float> alpha;                  // H×W
  Tensor<float> depth;                  // H×W
  Tensor<float> silhouette;             // H×W
  Tensor<float> main_position;          // M×3, of the posed main surfels
  Tensor<float> environment_residuals;  // N×outputs, of the environment's field
};

// Which parts of a scene a backward pass must reach. What is off is left at zero and its work is skipped
// where it can be.
struct Trainable {
  bool main = true;  // every group of the main surfels but tint
  bool tint = true;
  bool main_field = true;
  bool main_motion = true;
  bool main_nodes = true;
  bool lighting = true;
  bool environment = true;  // environment surfels, or the map
  bool environment_field = true;
  bool camera = true;  // its pose
};

// dL/d(parameters of a scene), with the signals that density control accumulates.
struct SceneGradient {
  Surfels main;
  Surfels environment;
  Field main_field;
  Motion main_motion;
  Nodes main_nodes;
  Lighting lighting;
  Field environment_field;
  EnvironmentMap environment_map;
  CameraGradient<float> camera;
  Tensor<float> main_signal;  // N, norm of the screen-space centre gradient (method §3.7); 0 where not drawn
  Tensor<uint8_t> main_visible;         // N
  Tensor<float> environment_signal;     // N, trace::BasicInputGradient::position_gradient
  Tensor<uint8_t> environment_visible;  // N, 1 where the signal is not zero

  // Zeros in the shapes of the scene and on its device.
  void reset(const Scene& scene);
};

}  // namespace traceflow
