#pragma once

#include <vector>

#include "math/camera.h"
#include "ops/raster/raster.h"
#include "ops/surface/surface.h"
#include "ops/trace/trace.h"
#include "scene/scene.h"

namespace traceflow {

// One image to render.
struct FrameRequest {
  Camera<float> camera;
  float time = 0;
  int sh_degree_main = 3;
  int sh_degree_environment = 3;
  bool deform_main = true;         // evaluate the main set's field, if there is one (method §7.1)
  bool deform_environment = true;  // evaluate the environment's field, if there is one
  bool specular = true;            // trace reflections, if the scene has any (method §7.2)
  bool pseudo_normals = false;     // compute N_d; only losses need it
  bool silhouette = false;         // draw the silhouette of the bodies; only losses need it
  bool probes = false;             // training: also trace a random share of the other pixels (method §4.4)
  uint64_t probe_seed = 0;
  // Skips main surfels outside the view by more than the scene's main_max_displacement. For training;
  // rendering does not cull.
  bool cull = false;
  // The most samples along a pixel's side. Fewer than the photographs had (render/samples.h) are faster, but
  // make small surfels look larger.
  int most_samples = 4;
  // Reuses the posed surfels and the tracer's BVH of the last forward() if they match the request. This is
  // faster, and the image is the same. The scene and the renderer's options must not have changed since; this
  // is not checked. Culling, or a forward() with keep_for_backward, always poses again.
  bool reuse_pose = false;
};

// The reflected rays of the traced pixels, and their hits.
struct MirroredRays {
  trace::Rays rays;               // P
  Tensor<float> alpha, distance;  // P, as in trace::Output; empty with an environment map
};

// An image with all its layers, on the device of the scene.
struct Frame {
  Camera<float> camera;         // what it is seen by
  raster::Options drawn_with;   // the rasteriser's options
  PosedSurfels main;            // the rasterised surfels
  Tensor<int32_t> subset;       // indices of these among the stored main surfels; empty means all
  PosedSurfels environment;     // the traced surfels
  raster::Output raster;        // the rasterised layers; the silhouette only if requested
  Tensor<float> pseudo_normal;  // H×W×3, if requested
  int samples = 1;              // along a pixel's side (method §3.6)
  // Indices are of pixels in the image of the samples, which is `samples` times as wide and as high.
  surface::TracedPixels traced;
  MirroredRays mirrored;
  Tensor<float> specular_rays;     // P×3, specular colours of the traced pixels
  Tensor<float> colour;            // H×W×3, the final image (method §6)
  Tensor<float> max_displacement;  // one number: the largest distance by which the field moved a main surfel

  // The specular colours as an image on the CPU: H×W×3, the mean over the traced samples of a pixel, black if
  // there is none.
  Tensor<float> specular_image() const;
};

// dL/d(layers of a frame). An empty tensor means zero.
struct FrameGradient {
  Tensor<float> colour;                 // H×W×3
  Tensor<float> normal;                 // H×W×3
  Tensor<float> pseudo_normal;          // H×W×3
  Tensor<float> depth;                  // H×W
  Tensor<float> distortion;             // H×W
  Tensor<float> alpha;                  // H×W
  Tensor<float> silhouette;             // H×W
  Tensor<float> main_position;          // M×3, for the posed main surfels
  Tensor<float> environment_residuals;  // N×outputs, for the environment's field
};

// The parts of a scene that a backward pass must compute. The gradient of other parts stays zero, and their
// work is skipped where possible.
struct Trainable {
  bool main = true;  // all values of the main surfels except tint
  bool tint = true;
  bool main_field = true;
  bool main_motion = true;
  bool main_nodes = true;
  bool lighting = true;
  bool environment = true;  // environment surfels or map
  bool environment_field = true;
  bool camera = true;  // the camera's pose
};

// dL/d(parameters of a scene), and the signals of density control.
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
  Tensor<float> main_signal;         // N, norm of the centre's screen gradient (method §3.7); 0 if not drawn
  Tensor<uint8_t> main_visible;      // N
  Tensor<float> environment_signal;  // N, trace::BasicInputGradient::position_gradient
  Tensor<uint8_t> environment_visible;  // N, 1 if the signal is not zero

  // Sets zeros in the shapes of the scene and on its device.
  void reset(const Scene& scene);
};

}  // namespace traceflow
