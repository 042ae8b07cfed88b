#pragma once

#include "math/rotation.h"
#include "ops/surface/surface.h"
#include "support/gradients.h"

namespace traceflow::testing {

// A bumpy surface seen by a turned camera, with a hole in it.
struct SurfaceScene {
  Camera<double> camera;
  Tensor<double> depth, median_depth, alpha, normal;
  double depth_ratio = 0.3;

  SurfaceScene(int width, int height, uint64_t seed = 1) {
    Random random(seed);
    camera.width = width;
    camera.height = height;
    camera.focal_x = 1.1 * width;
    camera.focal_y = 1.3 * width;
    camera.centre_x = 0.45 * width;
    camera.centre_y = 0.55 * height;
    camera.camera_from_world = rotation_from_quaternion(Vec4<double>(0.9, -0.3, 0.2, 0.5));
    camera.position = {0.4, -0.2, 0.7};
    const Shape shape{height, width};
    depth = random_tensor<double>(shape, random, 1.9, 2.1);
    median_depth = random_tensor<double>(shape, random, 1.9, 2.1);
    alpha = random_tensor<double>(shape, random, 0.5, 1);
    alpha(height / 2, width / 2) = 0;
    normal = random_tensor<double>({height, width, 3}, random, -1, 1);
  }
};

// The same scene twice: without a median where it is faint, as at a silhouette, and with one there that is
// the expected depth. Both show the same surface.
inline std::pair<SurfaceScene, SurfaceScene> with_and_without_medians(SurfaceScene with) {
  SurfaceScene without = with;
  for (int64_t i = 0; i < with.depth.size(); i += 4) {
    with.median_depth[i] = with.depth[i];
    without.median_depth[i] = 0;
  }
  return {std::move(with), std::move(without)};
}

// Where there is no median the expected depth has all of the gradient.
inline void expect_gradients_without_medians(const SurfaceScene& without, const Tensor<double>& depth,
                                             const Tensor<double>& median_depth,
                                             const Tensor<double>& with_depth,
                                             const Tensor<double>& with_median) {
  for (int64_t i = 0; i < depth.size(); ++i) {
    const bool has_median = without.median_depth[i] > 0;
    EXPECT_NEAR(depth[i], with_depth[i] + (has_median ? 0 : with_median[i]), 1e-9) << i;
    EXPECT_NEAR(median_depth[i], has_median ? with_median[i] : 0, 1e-9) << i;
  }
}

template <class T>
std::vector<Tensor<T>> camera_tensors(const CameraGradient<T>& gradient) {
  Tensor<T> rotation({3, 3}), position({3});
  for (int c = 0; c < 3; ++c) store3(rotation.row(c), gradient.camera_from_world[c]);
  store3(position.data(), gradient.position);
  return {rotation, position};
}

// Central differences by the nine entries of camera_from_world (column after column) and by the position.
template <class F>
std::vector<Tensor<double>> camera_differences(Camera<double>& camera, F&& value) {
  Tensor<double> rotation({3, 3}), position({3});
  for (int c = 0; c < 3; ++c) store3(rotation.row(c), camera.camera_from_world[c]);
  store3(position.data(), camera.position);
  const auto moved = [&] {
    for (int c = 0; c < 3; ++c) camera.camera_from_world[c] = load3<double>(rotation.row(c));
    camera.position = load3<double>(position.data());
    return value();
  };
  std::vector<Tensor<double>> gradients{central_differences(rotation, moved),
                                        central_differences(position, moved)};
  moved();
  return gradients;
}

}  // namespace traceflow::testing
