#include "train/camera_alignment.h"

#include <limits>

#include "capture/pixels.h"
#include "train/camera_refinement.h"
#include "train/objective.h"

namespace traceflow {

namespace {

// Trainable.main stays set, because the renderer needs the geometry of the main surfels for the camera's
// gradient.
Trainable camera_alone() {
  Trainable trainable;
  trainable.tint = trainable.main_field = trainable.main_motion = trainable.main_nodes = false;
  trainable.lighting = trainable.environment = trainable.environment_field = false;
  return trainable;
}

}  // namespace

Camera<float> aligned_camera(Renderer& renderer, const Scene& scene, const FrameRequest& request,
                             ViewImages& photograph, const LossOptions& loss,
                             const CameraAlignment& options) {
  LossOptions photometric = loss;
  photometric.normal = photometric.normal_prior = photometric.distortion = photometric.silhouette = 0;
  photometric.lpips = photometric.rigidity = photometric.environment_residual = 0;
  FrameRequest moving = request;
  FrameGradient by_frame;
  Tensor<float> by_rest;
  SceneGradient gradient;
  LossMeans means;
  CameraSteps steps;
  Vec3<double> turn(0), shift(0);
  Camera<float> best = request.camera;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= options.iterations; ++i) {
    const Frame& frame = renderer.forward(scene, moving, true);
    take_unknown(frame.colour, photograph);
    evaluate_objective({frame, photograph, photometric}, {by_frame, by_rest}, means);
    leave_unknown(photograph, by_frame.colour);
    const double now = means.read().total;
    if (now < least) {
      least = now;
      best = moving.camera;
    }
    if (i == options.iterations) break;
    gradient.reset(scene);
    renderer.backward(scene, moving, camera_alone(), by_frame, gradient);
    steps.step(pose_gradient(moving.camera, gradient.camera),
               optimize::log_linear(options.rate, options.rate_end, i, options.iterations), scene.extent, {},
               turn, shift);
    moving.camera = moved(request.camera, turn, shift);
  }
  return best;
}

}  // namespace traceflow
