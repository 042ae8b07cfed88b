#include "render/renderer.h"

#include "base/parallel.h"
#include "math/spherical_harmonics.h"
#include "ops/shade/shade.h"
#include "primitives/batched_fill.h"
#include "primitives/sums.h"
#include "render/frame_kernels.h"
#include "render/samples.h"
#include "render/visibility.h"

namespace traceflow {

namespace {

const Field* field_if(const std::optional<Field>& field, bool wanted) {
  return wanted && field ? &*field : nullptr;
}

int stored_degree(const Surfels& surfels) { return surfels.count() > 0 ? sh_degree(surfels.sh.dim(1)) : 0; }

StoredRow stored_row(const Frame& frame) { return {frame.subset.empty() ? nullptr : frame.subset.data()}; }

const Motion* motion_if(const Scene& scene) { return scene.main_motion ? &*scene.main_motion : nullptr; }
const Nodes* nodes_if(const Scene& scene) { return scene.main_nodes ? &*scene.main_nodes : nullptr; }

// Sets frame.max_displacement to the largest distance between posed and stored positions.
void find_max_displacement(const Surfels& stored, Frame& frame) {
  const SquareOfMove move{stored_row(frame), stored.position.data(), frame.main.position.data()};
  ordered_sum<LargestSquare>(stored.device(), "render: largest move", frame.main.count(), move,
                             KeepRoot{frame.max_displacement.data()}, 4096);
}

}  // namespace

Tensor<float> Frame::specular_image() const {
  const Tensor<int32_t> sample = traced.pixel.on(Device::cpu);
  const Tensor<float> rays = specular_rays.on(Device::cpu);
  const int64_t width = colour.dim(1), row = samples * width;
  Tensor<float> image(colour.shape());
  std::vector<float> count(static_cast<size_t>(colour.dim(0) * width), 0.0F);
  for (int64_t k = 0; k < sample.size(); ++k) {
    const int64_t pixel = sample[k] / row / samples * width + sample[k] % row / samples;
    float* mean = image.data() + 3 * pixel;
    const float share = 1 / ++count[static_cast<size_t>(pixel)];
    store3(mean, load3<float>(mean) + share * (load3<float>(rays.row(k)) - load3<float>(mean)));
  }
  return image;
}

void SceneGradient::reset(const Scene& scene) {
  BatchedZeroFill zeros;
  const auto like = [&](auto& gradient, const auto& parameters) {
    gradient.resize_like(parameters);
    gradient.for_each([&](const auto&, auto& tensor) { zeros.add(tensor); });
  };
  const auto sized = [&](auto& tensor, const Shape& shape) {
    tensor.place(scene.device()).resize(shape);
    zeros.add(tensor);
  };
  like(main, scene.main);
  like(environment, scene.environment);
  if (scene.main_field) like(main_field, *scene.main_field);
  if (scene.main_motion) like(main_motion, *scene.main_motion);
  if (scene.main_nodes) like(main_nodes, *scene.main_nodes);
  if (scene.lighting) like(lighting, *scene.lighting);
  if (scene.environment_field) like(environment_field, *scene.environment_field);
  if (scene.environment_map) {
    sized(environment_map.logit, scene.environment_map->logit.shape());
    if (!scene.environment_map->field) environment_map.field.reset();
    if (scene.environment_map->field) {
      if (!environment_map.field) environment_map.field.emplace();
      like(*environment_map.field, *scene.environment_map->field);
    }
  }
  camera = {};
  sized(main_signal, {scene.main.count()});
  sized(main_visible, {scene.main.count()});
  sized(environment_signal, {scene.environment.count()});
  sized(environment_visible, {scene.environment.count()});
  zeros.fill();
}

Renderer::Renderer(const RenderOptions& options, const KeptMemory& kept) : options_(options) {
  main_saved_.field.memory_limit = kept.field_bytes;
  environment_saved_.field.memory_limit = kept.field_bytes;
  map_saved_.field.memory_limit = kept.field_bytes;
  trace::limit_device_bytes(*trace_saved_, kept.hit_bytes);
}

bool Renderer::reflects(const Scene& scene, const FrameRequest& request) const {
  if (!request.specular || !scene.main.has_tint()) return false;
  if (scene.specular == Specular::environment_gaussians) return scene.environment.count() > 0;
  return scene.specular == Specular::environment_map && scene.environment_map.has_value();
}

trace::Options Renderer::trace_options(const Scene& scene) const {
  trace::Options options = options_.trace_options(scene.extent);
  if (scene.environment_map) options.background = Vec3<float>(0);
  return options;
}

void Renderer::pose_main(const Scene& scene, const FrameRequest& request, bool keep_for_backward) {
  const Field* field = field_if(scene.main_field, request.deform_main);
  const Device device = scene.device();
  const int degree = std::min(request.sh_degree_main, stored_degree(scene.main));
  const Motion* motion = motion_if(scene);
  const bool moves = field != nullptr || motion != nullptr || scene.lighting;
  const Pose pose{moves ? request.time : 0, degree, moves};
  const bool anew = keep_for_backward || request.cull;
  if (!anew && main_pose_ == pose) return;
  main_pose_.reset();

  frame_.subset.place(device).resize({0});
  if (request.cull) {
    surfels_in_view(scene.main, request.camera, frame_.drawn_with.near_plane, frame_.drawn_with.low_pass,
                    field ? scene.main_max_displacement.data() : nullptr, frame_.subset);
  }
  if (request.cull && frame_.subset.empty()) {
    frame_.main.reset_like(PosedSurfels{}.on(device));
  } else {
    deform::forward(scene.main, field, request.time, frame_.subset, degree, options_.precision, frame_.main,
                    keep_for_backward ? &main_saved_ : nullptr);
  }
  frame_.max_displacement.place(device).reset({1});
  if (field) find_max_displacement(scene.main, frame_);
  if (const Nodes* nodes = nodes_if(scene))
    nodes::forward(*nodes, scene.main.body, request.time, frame_.subset, frame_.main, *nodes_saved_);
  if (motion)
    motion::forward(*motion, scene.main.body, request.time, frame_.subset, frame_.main, *motion_saved_);
  if (scene.lighting)
    lighting::forward(*scene.lighting, scene.main.body, request.time, frame_.subset, frame_.main,
                      *lighting_saved_);
  if (!request.cull) main_pose_ = pose;
}

void Renderer::pose_environment(const Scene& scene, const FrameRequest& request, bool keep_for_backward) {
  const Field* field = field_if(scene.environment_field, request.deform_environment);
  const int degree = std::min(request.sh_degree_environment, stored_degree(scene.environment));
  const Pose pose{field ? request.time : 0, degree, field != nullptr};
  if (!keep_for_backward && environment_pose_ == pose) return;
  environment_pose_.reset();
  deform::forward(scene.environment, field, request.time, {}, degree, options_.precision, frame_.environment,
                  keep_for_backward ? &environment_saved_ : nullptr);
  trace::build(frame_.environment, options_.trace_options(scene.extent), *bvh_);
  environment_pose_ = pose;
}

const Frame& Renderer::forward(const Scene& scene, const FrameRequest& request, bool keep_for_backward) {
  const Device device = scene.device();
  frame_.camera = request.camera;
  frame_.drawn_with = options_.raster_options(scene.extent);
  frame_.samples = keep_for_backward ? options_.samples
                                     : samples::samples_for(request.camera, options_.samples, scene.focal,
                                                            request.most_samples);
  if (!keep_for_backward)
    frame_.drawn_with.low_pass *=
        samples::low_pass_for(request.camera, frame_.samples, options_.samples, scene.focal);

  // Pose the surfels that may be visible.
  if (!request.reuse_pose) {
    main_pose_.reset();
    environment_pose_.reset();
  }
  pose_main(scene, request, keep_for_backward);

  // Rasterise them.
  const bool draws_silhouette = request.silhouette && !scene.main.body.empty();
  frame_.main.in_body.place(device).resize({draws_silhouette ? frame_.main.count() : 0});
  if (draws_silhouette) {
    parallel_for(device, "render: surfels in bodies", frame_.main.in_body.size(),
                 IsInBody{stored_row(frame_), scene.main.body.data(), frame_.main.in_body.data()});
  }
  draw(request);
  if (request.pseudo_normals) {
    surface::pseudo_normals(request.camera, frame_.raster.depth, frame_.raster.median_depth,
                            frame_.raster.alpha, options_.depth_ratio, frame_.pseudo_normal);
  }

  // Reflect and trace.
  frame_.traced.pixel.place(device).resize({0});
  frame_.traced.weight.place(device).resize({0});
  frame_.specular_rays.place(device).resize({0, 3});
  MirroredRays& mirrored = frame_.mirrored;
  for (Tensor<float>* values : {&mirrored.rays.origins, &mirrored.rays.directions})
    values->place(device).resize({0, 3});
  for (Tensor<float>* values : {&mirrored.rays.widths, &mirrored.alpha, &mirrored.distance})
    values->place(device).resize({0});
  if (reflects(scene, request)) {
    forward_specular(scene, request, keep_for_backward);
  }
  shade::forward(drawn().colour, drawn().tint, frame_.traced.pixel, frame_.specular_rays,
                 has_several() ? sample_colour_ : frame_.colour);
  if (has_several()) samples::average(sample_colour_, frame_.samples, frame_.colour);
  return frame_;
}

void Renderer::draw(const FrameRequest& request) {
  raster::forward(frame_.main, camera_of_samples(request), frame_.drawn_with,
                  has_several() ? samples_ : frame_.raster, raster_saved_.get());
  if (has_several()) samples::average(samples_, frame_.samples, frame_.raster);
}

void Renderer::forward_specular(const Scene& scene, const FrameRequest& request, bool keep_for_backward) {
  trace::Rays& rays = frame_.mirrored.rays;
  // The number of probes in an image does not depend on the samples.
  surface::SelectOptions select = options_.select;
  select.probe_share /= static_cast<float>(frame_.samples * frame_.samples);
  surface::select_pixels(drawn().alpha, drawn().tint, drawn().normal, select, request.probes,
                         request.probe_seed, frame_.traced);
  surface::reflection_rays(camera_of_samples(request), frame_.traced.pixel, drawn().depth,
                           drawn().median_depth, drawn().normal, options_.depth_ratio, rays.origins,
                           rays.directions);
  if (scene.specular == Specular::environment_map) {
    reflection_map::forward(*scene.environment_map, rays.directions, request.time, request.deform_environment,
                            options_.precision, frame_.specular_rays, map_saved_);
    return;
  }
  pose_environment(scene, request, keep_for_backward);
  if (frame_.main.has_roughness()) {
    rays.widths.resize({rays.count()});
    parallel_for(scene.device(), "render: cone widths", rays.count(),
                 ConeWidths{frame_.traced.pixel.data(), drawn().roughness.data(), drawn().alpha.data(),
                            rays.widths.data()});
  }
  trace::forward(frame_.environment, *bvh_, rays, trace_options(scene), trace_output_,
                 keep_for_backward ? trace_saved_.get() : nullptr);
  if (scene.environment_map) {
    reflection_map::forward(*scene.environment_map, rays.directions, request.time, false, options_.precision,
                            behind_, map_saved_);
    parallel_for(scene.device(), "render: behind the environment", behind_.size(),
                 AddBehind{trace_output_.alpha.data(), behind_.data(), trace_output_.colour.data()});
  }
  frame_.specular_rays.swap(trace_output_.colour);
  frame_.mirrored.alpha.swap(trace_output_.alpha);
  frame_.mirrored.distance.swap(trace_output_.distance);
}

void Renderer::begin_raster_gradient(const FrameRequest& request, const FrameGradient& grad_frame,
                                     bool with_geometry, CameraGradient<float>* grad_camera) {
  const Shape none{0}, image = frame_.raster.alpha.shape();
  const Device device = frame_.raster.alpha.device();
  const bool faces = with_geometry && !grad_frame.pseudo_normal.empty();
  for (Tensor<float>* depth : {&grad_raster_.depth, &grad_raster_.median_depth})
    depth->place(device).reset(faces ? image : none);
  const auto take = [&](const Tensor<float>& layer, Tensor<float>& gradient) {
    if (with_geometry && !layer.empty()) {
      gradient = layer;
    } else {
      gradient.place(device).resize(none);
    }
  };
  take(grad_frame.alpha, grad_raster_.alpha);
  take(grad_frame.silhouette, grad_raster_.silhouette);
  take(grad_frame.distortion, grad_raster_.distortion);
  take(grad_frame.normal, grad_raster_.normal);
  if (faces) {
    surface::pseudo_normals_backward(request.camera, frame_.raster.depth, frame_.raster.median_depth,
                                     frame_.raster.alpha, options_.depth_ratio, grad_frame.pseudo_normal,
                                     grad_raster_.depth, grad_raster_.median_depth, grad_camera);
  }
  if (with_geometry && !grad_frame.depth.empty()) {
    if (faces) {
      parallel_for(device, "render: add depth gradients", grad_frame.depth.size(),
                   AddNumbers{grad_frame.depth.data(), grad_raster_.depth.data()});
    } else {
      grad_raster_.depth = grad_frame.depth;
    }
  }
  if (has_several()) {
    for (Tensor<float>* shaded : {&grad_raster_.colour, &grad_raster_.tint})
      shaded->place(device).resize(none);
    samples::average_backward(samples_, frame_.raster, frame_.samples, grad_raster_, grad_samples_);
  }
  raster::OutputGradient& grad = grad_drawn();
  grad.tint.place(device).reset(drawn().tint.shape());
  grad.roughness.place(device).reset(drawn().roughness.shape());
  if (!with_geometry || frame_.traced.pixel.empty()) return;
  // The gradients of reflected rays are added to these.
  if (frame_.main.has_roughness() && grad.alpha.empty())
    grad.alpha.place(device).reset(drawn().alpha.shape());
  if (grad.normal.empty()) grad.normal.place(device).reset(drawn().normal.shape());
  for (Tensor<float>* depth : {&grad.depth, &grad.median_depth})
    if (depth->empty()) depth->place(device).reset(drawn().depth.shape());
}

void Renderer::backward(const Scene& scene, const FrameRequest& request, const Trainable& trainable,
                        const FrameGradient& grad_frame, SceneGradient& gradient) {
  const Field* field = field_if(scene.main_field, request.deform_main);
  begin_raster_gradient(request, grad_frame, trainable.main, trainable.camera ? &gradient.camera : nullptr);
  raster::OutputGradient& grad = grad_drawn();

  // Shade.
  if (has_several()) samples::average_backward(grad_frame.colour, frame_.samples, grad_sample_colour_);
  shade::backward(drawn().colour, drawn().tint, frame_.traced.pixel, frame_.traced.weight,
                  frame_.specular_rays, has_several() ? grad_sample_colour_ : grad_frame.colour, grad.colour,
                  grad.tint, grad_trace_.colour);
  // Trace and reflect.
  if (!frame_.traced.pixel.empty()) backward_specular(scene, request, trainable, grad_frame, gradient);
  if (frame_.main.count() == 0 || !(trainable.main || trainable.tint || trainable.main_field ||
                                    trainable.main_motion || trainable.main_nodes))
    return;

  // Rasterise. With frozen geometry only the tint's gradient is needed (method §7.2).
  if (!trainable.main) grad.colour.resize({0});
  if (options_.depth_ratio == 0) grad.median_depth.resize({0});
  grad_raster_input_.wants_camera = trainable.camera;
  raster::backward(frame_.main, camera_of_samples(request), options_.raster_options(scene.extent),
                   *raster_saved_, grad, grad_raster_input_);
  parallel_for(scene.device(), "render: add gradients of positions", grad_frame.main_position.size(),
               AddNumbers{grad_frame.main_position.data(), grad_raster_input_.surfels.position.data()});
  gradient.camera.camera_from_world += grad_raster_input_.camera.camera_from_world;
  gradient.camera.position += grad_raster_input_.camera.position;
  raster::visible(*raster_saved_, drawn_);
  parallel_for(scene.device(), "render: place signals", frame_.main.count(),
               PlaceSignal{stored_row(frame_), grad_raster_input_.screen_gradient.data(), drawn_.data(),
                           gradient.main_signal.data(), gradient.main_visible.data()});
  // Light, move and deform.
  if (scene.lighting) {
    lighting::backward(*scene.lighting, request.time, frame_.main, *lighting_saved_,
                       grad_raster_input_.surfels, trainable.lighting ? &gradient.lighting : nullptr);
  }
  if (const Motion* motion = motion_if(scene)) {
    motion::backward(*motion, scene.main.body, request.time, frame_.subset, frame_.main, *motion_saved_,
                     grad_raster_input_.surfels, trainable.main_motion ? &gradient.main_motion : nullptr);
  }
  if (const Nodes* nodes = nodes_if(scene)) {
    nodes::backward(*nodes, scene.main.body, request.time, frame_.subset, *nodes_saved_,
                    grad_raster_input_.surfels, trainable.main_nodes ? &gradient.main_nodes : nullptr);
  }
  deform::backward(scene.main, field, request.time, frame_.subset, frame_.main, main_saved_,
                   grad_raster_input_.surfels, {}, gradient.main,
                   field && trainable.main_field ? &gradient.main_field : nullptr);
}

void Renderer::backward_specular(const Scene& scene, const FrameRequest& request, const Trainable& trainable,
                                 const FrameGradient& grad_frame, SceneGradient& gradient) {
  const trace::Rays& rays = frame_.mirrored.rays;
  Tensor<float>* grad_origins = &grad_trace_input_.rays.origins;
  Tensor<float>* grad_directions = &grad_trace_input_.rays.directions;
  if (scene.specular == Specular::environment_map) {
    grad_origins->place(scene.device()).reset(rays.origins.shape());
    reflection_map::backward(*scene.environment_map, rays.directions, request.time,
                             request.deform_environment, trainable.environment_field, map_saved_,
                             grad_trace_.colour, gradient.environment_map, *grad_directions);
  } else {
    const Field* field = field_if(scene.environment_field, request.deform_environment);
    if (scene.environment_map) {
      grad_trace_.alpha.place(scene.device()).resize(frame_.mirrored.alpha.shape());
      grad_behind_.place(scene.device()).resize(behind_.shape());
      parallel_for(scene.device(), "render: behind the environment backward", frame_.mirrored.alpha.size(),
                   AddBehindBackward{frame_.mirrored.alpha.data(), behind_.data(), grad_trace_.colour.data(),
                                     grad_trace_.alpha.data(), grad_behind_.data()});
      reflection_map::backward(*scene.environment_map, rays.directions, request.time, false, false,
                               map_saved_, grad_behind_, gradient.environment_map, grad_behind_directions_);
    }
    trace::backward(frame_.environment, rays, trace_options(scene), *trace_saved_, grad_trace_,
                    grad_trace_input_);
    if (scene.environment_map) {
      parallel_for(scene.device(), "render: add gradients of directions", grad_behind_directions_.size(),
                   AddNumbers{grad_behind_directions_.data(), grad_directions->data()});
    }
    gradient.environment_signal = grad_trace_input_.position_gradient;
    parallel_for(scene.device(), "render: flag signals", frame_.environment.count(),
                 FlagNonZero{gradient.environment_signal.data(), gradient.environment_visible.data()});
    if (trainable.environment) {
      deform::backward(scene.environment, field, request.time, {}, frame_.environment, environment_saved_,
                       grad_trace_input_.surfels, grad_frame.environment_residuals, gradient.environment,
                       field && trainable.environment_field ? &gradient.environment_field : nullptr);
    }
  }
  raster::OutputGradient& grad = grad_drawn();
  if (!rays.widths.empty()) {
    parallel_for(scene.device(), "render: cone widths backward", rays.count(),
                 ConeWidthsBackward{frame_.traced.pixel.data(), drawn().alpha.data(), rays.widths.data(),
                                    grad_trace_input_.rays.widths.data(), grad.roughness.data(),
                                    trainable.main ? grad.alpha.data() : nullptr});
  }
  if (!trainable.main) return;
  surface::reflection_rays_backward(camera_of_samples(request), frame_.traced.pixel, drawn().depth,
                                    drawn().median_depth, drawn().normal, options_.depth_ratio, *grad_origins,
                                    *grad_directions, grad.depth, grad.median_depth, grad.normal,
                                    trainable.camera ? &gradient.camera : nullptr);
}

}  // namespace traceflow
