#pragma once

#include <cmath>

#include "math/rotation_group.h"
#include "math/spherical_harmonics.h"
#include "ops/deform/deform.h"
#include "ops/motion/motion.h"
#include "track/pose_solver.h"

// A ball that a body carries, before a camera.
namespace traceflow::ball_body {

inline constexpr double radius = 0.5;
inline const Vec3<double> centre(0, 0, 2);

inline Vec3<double> pattern(const Vec3<double>& x) {
  return {0.5 + 0.3 * std::sin(9 * x.x + 2 * x.y), 0.5 + 0.3 * std::sin(7 * x.y - 3 * x.x),
          0.5 + 0.3 * std::cos(8 * x.z + 5 * x.x)};
}

inline void paint(const Vec3<double>& colour, float* sh) {
  for (int c = 0; c < 3; ++c) sh[c] = static_cast<float>((colour[c] - 0.5) / sh_c0);
}

// A ball of one body before a camera, in a pattern of colours.
inline Surfels ball() {
  constexpr int64_t count = 1600;
  Surfels s;
  s.position.reset({count, 3});
  s.log_scale.reset({count, 2});
  s.rotation.reset({count, 4});
  s.opacity_logit.reset({count});
  s.sh.reset({count, 1, 3});
  s.tint_logit.reset({count});
  s.body.reset({count});
  s.log_scale.fill(std::log(0.02F));
  s.opacity_logit.fill(4);
  for (int64_t i = 0; i < count; ++i) {
    const double z = 1 - (2 * static_cast<double>(i) + 1) / count, around = 2.399963 * static_cast<double>(i);
    const Vec3<double> n(std::sqrt(1 - z * z) * std::cos(around), std::sqrt(1 - z * z) * std::sin(around), z);
    store3(s.position.row(i), centre + radius * n);
    const Vec4<double> towards = quaternion_towards(n);
    for (int k = 0; k < 4; ++k) s.rotation(i, k) = static_cast<float>(towards[k]);
    paint(pattern(radius * n), s.sh.row(i));
  }
  return s;
}

inline Motion turned_by(const Vec3<double>& turn) {
  Tensor<float> pivot({1, 3});
  store3(pivot.row(0), centre);
  Motion motion = still_motion(pivot, tensor_of(std::vector<float>{0}));
  const Vec4<double> q = quaternion_exp(turn);
  for (int k = 0; k < 4; ++k) motion.rotation(0, 0, k) = static_cast<float>(q[k]);
  return motion;
}

// The picture of the ball where it has been turned. A texture has turned with it; of a mirror the colours are
// those of places, as if it had not turned.
inline TrackTarget picture_at(const Surfels& ball, const Motion& motion, bool mirrors) {
  TrackTarget target;
  target.camera.width = target.camera.height = 64;
  target.camera.focal_x = target.camera.focal_y = 90;
  target.camera.centre_x = target.camera.centre_y = 32;
  PosedSurfels posed;
  deform::forward(ball, nullptr, 0, {}, 0, field::Precision::fp32, posed, nullptr);
  const motion::SavedPtr saved = motion::make_saved();
  motion::forward(motion, ball.body, 0, {}, posed, *saved);
  for (int64_t i = 0; mirrors && i < posed.count(); ++i)
    paint(pattern(load3<double>(posed.position.row(i)) - centre), posed.sh.row(i));
  raster::Output picture;
  raster::forward(posed, target.camera, {}, picture, nullptr);
  target.colour = picture.colour;
  target.coverage = picture.alpha;
  target.normal_prior = picture.normal;
  target.mask.resize(picture.alpha.shape());
  for (int64_t i = 0; i < target.mask.size(); ++i) target.mask[i] = picture.alpha[i] > 0.5F ? 1 : 0;
  return target;
}
inline TrackTarget picture_of(const Surfels& ball, const Vec3<double>& turn, bool mirrors) {
  return picture_at(ball, turned_by(turn), mirrors);
}

// The ball, stretched along the axes.
inline Surfels stretched_ball(const Vec3<double>& by) {
  Surfels s = ball();
  for (int64_t i = 0; i < s.count(); ++i) {
    const Vec3<double> x = load3<double>(s.position.row(i)) - centre;
    store3(s.position.row(i), centre + by * x);
    const Vec4<double> towards = quaternion_towards(normalize(x / by));
    for (int k = 0; k < 4; ++k) s.rotation(i, k) = static_cast<float>(towards[k]);
  }
  return s;
}

}  // namespace traceflow::ball_body
