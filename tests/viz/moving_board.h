#pragma once

#include <cmath>

#include "render/cloud.h"
#include "viz/tracks.h"

namespace traceflow::viz {

// A board of 5 × 5 opaque surfels in the plane z = 0 that turns about the camera's axis, a sixth of a turn
// and a shift in all, and a wall behind it that stands still. The camera is 3 before it.
struct MovingBoard : Fixture {
  static constexpr int side = 5, points = side * side;
  static constexpr double angle = 1.0471975511965976;
  std::vector<float> times = {0, 0.25F, 0.5F, 0.75F, 1};
  RenderOptions options;

  MovingBoard() {
    Random random(1);
    scene = Scene();
    scene.extent = 1;
    scene.specular = Specular::none;
    scene.main = scattered(2 * points, 0, true, random);
    Surfels& s = scene.main;
    s.opacity_logit.fill(6);
    s.log_scale.fill(std::log(0.06F));
    s.tint_logit.fill(-20);
    s.body.reset({2 * points});
    for (int64_t i = 0; i < 2 * points; ++i) {
      const bool is_wall = i >= points;
      const auto column = static_cast<float>(i % side - side / 2),
                 row = static_cast<float>(i / side % side - side / 2);
      store3(s.position.row(i), is_wall ? Vec3<float>(column, row, 2) : Vec3<float>(column, row, 0) * 0.15F);
      for (int64_t k = 0; k < 4; ++k) s.rotation(i, k) = k == 0 ? 1 : 0;
      if (is_wall) s.log_scale(i, 0) = s.log_scale(i, 1) = 0;
      s.body[i] = is_wall ? motionless : 0;
    }
    Tensor<float> centre(Shape{1, 3});
    centre(0, 0) = 0.1F;
    scene.main_motion = still_motion(centre, tensor_of(times));
    for (size_t k = 0; k < times.size(); ++k) {
      const auto key = static_cast<int64_t>(k);
      scene.main_motion->rotation(0, key, 0) = static_cast<float>(std::cos(angle * times[k] / 2));
      scene.main_motion->rotation(0, key, 3) = static_cast<float>(std::sin(angle * times[k] / 2));
      store3(&scene.main_motion->shift(0, key, 0), Vec3<float>(shift_at(times[k])));
    }
  }

  static Vec3<double> shift_at(double time) { return {0.3 * time, -0.2 * time, 0.4 * time}; }
  // By hand: what `bent` adds, a turn about the axis z through (0.1, 0), then the shift.
  Vec3<double> place_at(int64_t i, double time) const {
    const double bent = scene.main_nodes ? 0.2 * time : 0;
    const double x = double{scene.main.position(i, 0)} + bent - double{0.1F}, y = scene.main.position(i, 1);
    const double c = std::cos(angle * time), s = std::sin(angle * time);
    return Vec3<double>(c * x - s * y + double{0.1F}, s * x + c * y, 0) + shift_at(time);
  }
  // By hand as well: a camera that looks along z.
  static Vec2<double> pixel_of(const Vec3<double>& p, const Camera<float>& camera) {
    const Vec3<double> from = p - Vec3<double>(camera.position);
    return {double{camera.focal_x} * from.x / from.z + double{camera.centre_x},
            double{camera.focal_y} * from.y / from.z + double{camera.centre_y}};
  }

  // The body has one node, which goes along x by 0.2 over the film.
  void bend() {
    scene.main_nodes = Nodes{Tensor<int32_t>(Shape{1}),     tensor_of(std::vector<float>{0, 1}),
                             Tensor<float>(Shape{1, 3}),    tensor_of(std::vector<float>{1}),
                             Tensor<float>(Shape{1, 2, 3}), Tensor<float>(Shape{1, 2, 3}),
                             Tensor<float>(Shape{1, 2, 3})};
    scene.main_nodes->shift(0, 1, 0) = 0.2F;
  }

  TrackFollower follower() const { return {scene, request, options, times}; }
  const Frame& frame_at(float time) {
    request.time = time;
    return renderer_.forward(scene, request);
  }

 private:
  Renderer renderer_{RenderOptions{}};
};

}  // namespace traceflow::viz
