#include "ops/raster/body_jacobian.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "math/rotation_group.h"
#include "raster_scenes.h"
#include "support/gradients.h"

namespace traceflow::raster {
namespace {

struct BodyScene {
  TestScene<double> scene;
  Tensor<int32_t> body;
  Tensor<float> pivot;
};

// Of three surfels one stands still and two are carried, by different bodies.
BodyScene body_scene(uint64_t seed, double opacity_max = 0.9) {
  SceneOptions options;
  options.count = 12;
  options.opacity_max = opacity_max;
  BodyScene made{random_scene(seed, 40, 24, options), Tensor<int32_t>({options.count}),
                 Tensor<float>({2, 3})};
  // Colours that are the same from every side.
  const Tensor<double> sh = made.scene.surfels.sh;
  made.scene.surfels.sh.reset({options.count, 1, 3});
  for (int64_t i = 0; i < options.count; ++i) {
    std::copy_n(sh.row(i), 3, made.scene.surfels.sh.row(i));
    made.body[i] = static_cast<int32_t>(i % 3) - 1;
    made.scene.surfels.tint[i] = made.body[i] >= 0 ? 1 : 0;
  }
  for (int64_t b = 0; b < 2; ++b) std::copy_n(made.scene.surfels.position.row(b + 1), 3, made.pivot.row(b));
  return made;
}

// Silhouette, normals and colour, H·W×7, by the reference.
Tensor<double> reference_picture(const BasicPosedSurfels<double>& surfels, const Camera<double>& camera,
                                 const Options& options) {
  BasicOutput<double> output;
  forward_reference(surfels, camera, options, output);
  Tensor<double> result({output.alpha.size(), 7});
  for (int64_t i = 0; i < output.alpha.size(); ++i) {
    result(i, 0) = output.tint[i];
    for (int k = 0; k < 3; ++k) {
      result(i, k + 1) = output.normal[3 * i + k];
      result(i, k + 4) = output.colour[3 * i + k];
    }
  }
  return result;
}

// The same after body b has been moved by a turn and a shift.
Tensor<double> picture_after(const BodyScene& at, const Options& options, int b, const Vec3<double>& turn,
                             const Vec3<double>& shift) {
  BasicPosedSurfels<double> moved = at.scene.surfels;
  const Vec4<double> q = quaternion_exp(turn);
  const Mat3<double> matrix = rotation_from_quaternion(q);
  const Vec3<double> pivot = load3<double>(at.pivot.row(b));
  for (int64_t i = 0; i < moved.count(); ++i) {
    if (at.body[i] != b) continue;
    store3(moved.position.row(i), matrix * (load3<double>(moved.position.row(i)) - pivot) + pivot + shift);
    const Vec4<double> turned = quaternion_product(q, load4<double>(moved.rotation.row(i)));
    for (int k = 0; k < 4; ++k) moved.rotation(i, k) = turned[k];
  }
  return reference_picture(moved, at.scene.camera, options);
}

Tensor<float> jacobian_of(const PosedSurfels& surfels, const Tensor<int32_t>& body,
                          const Tensor<float>& pivot, const Camera<float>& camera, const Options& options) {
  Output output;
  const SavedPtr saved = make_saved();
  forward(surfels, camera, options, output, saved.get());
  Tensor<float> jacobian;
  body_jacobian(surfels, body, pivot, camera, options, *saved, jacobian);
  return jacobian;
}

Tensor<float> jacobian_of(const BodyScene& at, const Options& options) {
  return jacobian_of(convert<float>(at.scene.surfels), at.body, at.pivot, convert<float>(at.scene.camera),
                     options);
}

// Where a surfel's edge or the order of two is crossed, differences see a step that derivatives do not: such
// pixels are few.
TEST(BodyJacobian, AgreesWithCentralDifferencesOfTheReference) {
  Options options;
  options.background = {0.3F, 0.6F, 0.9F};
  options.alpha_min = 1e-6F;  // edges fade to nothing
  constexpr double step = 1e-5;
  int64_t compared = 0, apart = 0;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    const BodyScene at = body_scene(seed);
    const Tensor<float> jacobian = jacobian_of(at, options);
    ASSERT_EQ(jacobian.shape(), (Shape{24, 40, 12, 7}));
    for (int p = 0; p < 12; ++p) {
      Vec3<double> turn(0), shift(0);
      (p % 6 < 3 ? turn : shift)[p % 3] = step;
      const Tensor<double> above = picture_after(at, options, p / 6, turn, shift);
      const Tensor<double> below = picture_after(at, options, p / 6, -turn, -shift);
      for (int64_t i = 0; i < above.size(); ++i) {
        const double expected = (above[i] - below[i]) / (2 * step);
        const double found = jacobian[(i / 7 * 12 + p) * 7 + i % 7];
        ++compared;
        apart += std::abs(found - expected) > 2e-3 * (1 + std::abs(expected)) ? 1 : 0;
      }
    }
  }
  EXPECT_LT(static_cast<double>(apart), 0.002 * static_cast<double>(compared)) << apart << " of " << compared;
}

TEST(BodyJacobian, IsTheSameBytesAtAnyThreadCount) {
  const BodyScene at = body_scene(3);
  testing::expect_same_bytes_at_any_thread_count(
      [&] { return std::vector<Tensor<float>>{jacobian_of(at, {})}; });
}

TEST(BodyJacobian, WithoutSurfelsIsZero) {
  PosedSurfels none;
  none.position.resize({0, 3});
  none.scale.resize({0, 2});
  none.rotation.resize({0, 4});
  none.opacity.resize({0});
  none.sh.resize({0, 1, 3});
  const Tensor<float> jacobian = jacobian_of(none, Tensor<int32_t>(Shape{0}), Tensor<float>({1, 3}),
                                             convert<float>(test_camera(20, 10)), {});
  ASSERT_EQ(jacobian.shape(), (Shape{10, 20, 6, 7}));
  for (const float value : jacobian.values()) EXPECT_EQ(value, 0);
}

}  // namespace
}  // namespace traceflow::raster
