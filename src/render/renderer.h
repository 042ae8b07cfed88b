#pragma once

#include "ops/deform/deform.h"
#include "ops/lighting/lighting.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"
#include "render/frame.h"
#include "render/reflection_map.h"
#include "render/render_options.h"
#include "render/samples.h"

namespace traceflow {

// Limits, in bytes, for what ops save for backward. What does not fit is computed again.
struct KeptMemory {
  int64_t field_bytes = int64_t{1} << 29;  // activations of each field
  int64_t hit_bytes = int64_t{1} << 30;    // the tracer's hits; limited on the CUDA device only
};

// Runs the ops for a frame (method §1.3 … §6) and, in reverse order, their derivatives. Keeps its memory, so
// that a renderer used for many frames stops allocating. Runs on the device of the scene.
class Renderer {
 public:
  explicit Renderer(const RenderOptions& options, const KeptMemory& kept = {});

  const RenderOptions& options() const { return options_; }
  RenderOptions& options() { return options_; }

  // Deform → rasterise → surface → reflect → trace → shade. The frame stays valid until the next call.
  // keep_for_backward: false saves the work and memory that only backward() needs.
  const Frame& forward(const Scene& scene, const FrameRequest& request, bool keep_for_backward = false);

  // Adds dL/dscene to `gradient`, which the caller has reset to the scene's shapes. Differentiates the last
  // forward() with keep_for_backward, for the same scene and request.
  void backward(const Scene& scene, const FrameRequest& request, const Trainable& trainable,
                const FrameGradient& grad_frame, SceneGradient& gradient);

  // What the environment's field added to its surfels, N×outputs, in the last forward() that traced with
  // keep_for_backward. Empty if there is no field.
  const Tensor<float>& environment_residuals() const { return environment_saved_.residuals; }

 private:
  // The parameters with which a set was posed.
  struct Pose {
    float time;
    int sh_degree;
    bool deformed;
    bool operator==(const Pose&) const = default;
  };

  void pose_main(const Scene& scene, const FrameRequest& request, bool keep_for_backward);
  // Also builds the tracer's BVH.
  void pose_environment(const Scene& scene, const FrameRequest& request, bool keep_for_backward);
  // Rasterises the layers of the samples and averages them per pixel.
  void draw(const FrameRequest& request);
  bool has_several() const { return frame_.samples > 1; }  // samples per pixel
  Camera<float> camera_of_samples(const FrameRequest& request) const {
    return samples::camera_of(request.camera, frame_.samples);
  }
  // The layers of the samples, which are those of the pixels if each has one sample; and their gradient.
  const raster::Output& drawn() const { return has_several() ? samples_ : frame_.raster; }
  raster::OutputGradient& grad_drawn() { return has_several() ? grad_samples_ : grad_raster_; }
  void forward_specular(const Scene& scene, const FrameRequest& request, bool keep_for_backward);
  // Starts the gradient of the samples' layers from those of the frame's layers, except colour. Without
  // geometry it has only the tint's gradient, and others stay empty.
  void begin_raster_gradient(const FrameRequest& request, const FrameGradient& grad_frame, bool with_geometry,
                             CameraGradient<float>* grad_camera);
  void backward_specular(const Scene& scene, const FrameRequest& request, const Trainable& trainable,
                         const FrameGradient& grad_frame, SceneGradient& gradient);
  bool reflects(const Scene& scene, const FrameRequest& request) const;
  trace::Options trace_options(const Scene& scene) const;

  RenderOptions options_;
  Frame frame_;
  std::optional<Pose> main_pose_, environment_pose_;  // of all surfels of the last scene, in frame_
  deform::Saved main_saved_, environment_saved_;
  motion::SavedPtr motion_saved_ = motion::make_saved();
  nodes::SavedPtr nodes_saved_ = nodes::make_saved();
  lighting::SavedPtr lighting_saved_ = lighting::make_saved();
  raster::SavedPtr raster_saved_ = raster::make_saved();
  trace::BvhPtr bvh_ = trace::make_bvh();
  trace::SavedPtr trace_saved_ = trace::make_saved();
  trace::Output trace_output_;
  reflection_map::Saved map_saved_;
  Tensor<float> behind_;  // P×3, what is behind the environment surfels; then its gradients
  Tensor<float> grad_behind_, grad_behind_directions_;
  raster::Output samples_;       // the layers of the samples, if a pixel has several
  Tensor<float> sample_colour_;  // their shaded colours; then the gradient
  Tensor<float> grad_sample_colour_;
  Tensor<uint8_t> drawn_;  // by posed surfel: whether it was drawn

  raster::OutputGradient grad_raster_, grad_samples_;
  raster::InputGradient grad_raster_input_;
  trace::OutputGradient grad_trace_;
  trace::InputGradient grad_trace_input_;
};

}  // namespace traceflow
