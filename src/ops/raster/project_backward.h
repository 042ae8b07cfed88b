#pragma once

#include <cmath>

#include "math/rotation.h"
#include "math/spherical_harmonics.h"
#include "math/surfel_projection.h"
#include "ops/raster/raster_kernels.h"
#include "scene/surfel_views.h"

// Backward pass of ProjectSurfel: from the sums over pixels to the gradients of the surfels and of the
// camera's pose.
namespace traceflow::raster {

// Processes one surfel, on either device.
struct ProjectBackward {
  PosedSurfelsView surfels;
  Camera<double> camera;
  const Splat* splats;
  float rho_per_pixel2;  // as in Saved
  const uint32_t* entry_begin;
  const uint16_t* touched;
  const SplatGradient* gradients;  // by entry
  uint32_t max_tiles;              // if a surfel has more entries, its first entry holds the sum of all
  MutablePosedSurfelsView to;
  float* screen_gradient;

  // Sets the surfel's gradients and returns its contribution to the camera's gradient.
  TRACEFLOW_HD CameraGradient<double> run(int64_t i) const {
    prefetch_ahead(i + 8);
    clear(i);
    SplatGradient sums{};
    CameraGradient<double> camera_gradient;
    if (add_tiles(i, sums)) backward(i, sums, camera_gradient);
    return camera_gradient;
  }

 private:
  TRACEFLOW_HD void prefetch_ahead(int64_t i) const {
    if (i >= surfels.count || entry_begin[i] == entry_begin[i + 1]) return;
    prefetch(surfels.position + 3 * i, 12);
    prefetch(surfels.scale + 2 * i, 8);
    prefetch(surfels.rotation + 4 * i, 16);
    prefetch(surfels.sh + surfels.sh_row * i, surfels.sh_row * int64_t{sizeof(float)});
    prefetch(splats + i, sizeof(Splat));
    prefetch(gradients + entry_begin[i], sizeof(SplatGradient));
    prefetch(touched + entry_begin[i], sizeof(uint16_t));
  }

  TRACEFLOW_HD void clear(int64_t i) const {
    for (int k = 0; k < 3; ++k) to.position[3 * i + k] = 0;
    for (int k = 0; k < 2; ++k) to.scale[2 * i + k] = 0;
    for (int k = 0; k < 4; ++k) to.rotation[4 * i + k] = 0;
    for (int64_t k = 0; k < to.sh_row; ++k) to.sh[to.sh_row * i + k] = 0;
    to.opacity[i] = 0;
    if (to.tint != nullptr) to.tint[i] = 0;
    if (to.roughness != nullptr) to.roughness[i] = 0;
    screen_gradient[i] = 0;
  }

  // Adds up the tiles that blended the surfel, in order. Returns false if there is nothing to propagate.
  TRACEFLOW_HD bool add_tiles(int64_t i, SplatGradient& sums) const {
    const uint32_t begin = entry_begin[i];
    const uint32_t end = entry_begin[i + 1];
    if (end - begin > max_tiles) {
      sums = gradients[begin];
      return !is_zero(sums);
    }
    bool any = false;
    for (uint32_t entry = begin; entry < end; ++entry) {
      if (touched[entry] == 0) continue;
      any = true;
      const float* const from = &gradients[entry].u_x;
      float* const sum = &sums.u_x;
      for (size_t k = 0; k < sizeof(SplatGradient) / sizeof(float); ++k) sum[k] += from[k];
    }
    return any;
  }

  static TRACEFLOW_HD bool is_zero(const SplatGradient& sums) {
    const float* const sum = &sums.u_x;
    for (size_t k = 0; k < sizeof(SplatGradient) / sizeof(float); ++k) {
      if (sum[k] != 0) return false;
    }
    return true;
  }

  TRACEFLOW_HD void backward(int64_t i, const SplatGradient& sums,
                             CameraGradient<double>& camera_gradient) const {
    const SurfelFrame<double> frame = surfel_frame(surfels, i);
    const Vec3<double> from_camera = frame.position - camera.position;
    const Vec3<double> centre = camera.camera_from_world * from_camera;
    const SurfelForms<double> forms = surfel_forms(frame, camera);
    SurfelFormsGradient<double> g = surfel_forms_backward(frame, camera, forms, forms_gradient(i, sums));

    Vec3<double> grad_centre(0, 0, sums.z_centre);
    if (splats[i].has_low_pass()) {
      grad_centre += project_backward(camera, centre,
                                      double{rho_per_pixel2} * Vec2<double>(sums.centre_x, sums.centre_y));
    }
    g.from_camera += grad_centre * camera.camera_from_world;
    g.camera_from_world += outerProduct(grad_centre, from_camera);
    screen_gradient[i] = screen_gradient_of(g.from_camera, centre.z);
    g.from_camera += colour_gradient(i, from_camera, sums);
    g.rotation[2] += (dot(frame.rotation[2], from_camera) > 0 ? -1.0 : 1.0) * load3<double>(sums.normal);

    store3(to.position + 3 * i, g.from_camera);
    for (int a = 0; a < 2; ++a) to.scale[2 * i + a] = static_cast<float>(g.scale[a]);
    const auto q = rotation_from_quaternion_backward(load4<double>(surfels.rotation + 4 * i), g.rotation);
    for (int a = 0; a < 4; ++a) to.rotation[4 * i + a] = static_cast<float>(q[a]);
    to.opacity[i] = sums.log_opacity / surfels.opacity[i];
    if (to.tint != nullptr) to.tint[i] = sums.tint;
    if (to.roughness != nullptr) to.roughness[i] = sums.roughness;
    camera_gradient.camera_from_world = g.camera_from_world;
    camera_gradient.position = -g.from_camera;
  }

  // The sums are over pixels relative to the splat's anchor.
  TRACEFLOW_HD SurfelForms<double> forms_gradient(int64_t i, const SplatGradient& sums) const {
    const Splat& splat = splats[i];
    const Vec3<double> ray = camera.ray_in_camera(splat.anchor_x, splat.anchor_y);
    const auto form = [&](double x, double y, double one) {
      return one * ray + Vec3<double>(x / camera.focal_x, y / camera.focal_y, 0);
    };
    return {form(sums.u_x, sums.u_y, sums.u_1), form(sums.v_x, sums.v_y, sums.v_1),
            form(sums.w_x, sums.w_y, sums.w_1), sums.z_plane, 0};
  }

  // A shift of the projected centre by one pixel at constant depth moves the surfel by z/focal.
  TRACEFLOW_HD float screen_gradient_of(const Vec3<double>& grad_position, double z) const {
    const Vec3<double> g = camera.camera_from_world * grad_position;
    const double x = g.x * z / camera.focal_x * camera.width / 2;
    const double y = g.y * z / camera.focal_y * camera.height / 2;
    return static_cast<float>(std::sqrt(x * x + y * y));
  }

  // Sets the gradient of the harmonics. Returns the gradient of the vector from the camera to the surfel.
  TRACEFLOW_HD Vec3<double> colour_gradient(int64_t i, const Vec3<double>& from_camera,
                                            const SplatGradient& sums) const {
    const double distance = length(from_camera);
    const Vec3<double> direction = from_camera / distance;
    const Vec3<double> grad(sh_colour_backward<float>(surfels.sh_degree, surfels.sh + surfels.sh_row * i,
                                                      Vec3<float>(direction), load3<float>(sums.colour),
                                                      to.sh + to.sh_row * i));
    return (grad - dot(grad, direction) * direction) / distance;
  }
};

// Runs ProjectBackward for each surfel. Stores the surfel's contribution to the camera's gradient if `camera`
// is not null.
struct ProjectBackwardStep {
  ProjectBackward op;
  CameraGradient<double>* camera;  // N, may be null

  TRACEFLOW_HD void operator()(int64_t i) const {
    const CameraGradient<double> share = op.run(i);
    if (camera != nullptr) camera[i] = share;
  }
};

// Terms of the sum over the surfels' contributions.
struct CameraShareOf {
  const CameraGradient<double>* camera;
  TRACEFLOW_HD CameraGradient<double> operator()(int64_t i) const { return camera[i]; }
};

}  // namespace traceflow::raster
