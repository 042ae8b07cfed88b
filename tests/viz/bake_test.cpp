#include "viz/bake.h"

#include <gtest/gtest.h>

#include <cmath>

#include "viz/moving_subject.h"

namespace traceflow::viz {
namespace {

std::vector<Camera<float>> cameras_beside_each_other(int count) {
  std::vector<Camera<float>> cameras(static_cast<size_t>(count), camera_in_scene());
  for (int i = 0; i < count; ++i) cameras[static_cast<size_t>(i)].position.x += 0.2F * static_cast<float>(i);
  return cameras;
}

bool go_on(int64_t, int64_t) { return true; }

double mean_psnr_of(const Subject& subject, const Surfels& main, float time,
                    const std::vector<Camera<float>>& cameras) {
  Subject plain;
  plain.scene.main = main;
  plain.scene.main.tint_logit = Tensor<float>();
  plain.scene.specular = Specular::none;
  plain.scene.extent = subject.scene.extent;
  plain.render = subject.render;
  double sum = 0;
  for (const Camera<float>& camera : cameras) {
    Renderer traced(subject.render), untraced(subject.render);
    FrameRequest request = subject.request;
    request.camera = camera;
    request.time = time;
    const Tensor<float> a = traced.forward(subject.scene, request).colour;
    const Tensor<float> b = untraced.forward(plain.scene, request).colour;
    double error = 0;
    for (int64_t i = 0; i < a.size(); ++i)
      error += std::pow(std::clamp(double{a[i]}, 0.0, 1.0) - std::clamp(double{b[i]}, 0.0, 1.0), 2);
    sum += -10 * std::log10(error / static_cast<double>(a.size()));
  }
  return sum / static_cast<double>(cameras.size());
}

Subject subject_to_bake() {
  Subject subject = moving_subject();
  subject.scene.focal = 0;  // one sample per pixel
  return subject;
}

// Oracle: the images that both are compared in, rendered apart.
TEST(Bake, HarmonicsTakeThePlaceOfReflections) {
  const Subject subject = subject_to_bake();
  const auto cameras = cameras_beside_each_other(4);
  const Surfels posed = posed_main(subject, 0.5F);
  const Baked baked = bake(subject, 0.5F, posed, cameras, nullptr, go_on);
  EXPECT_NEAR(baked.psnr_without, mean_psnr_of(subject, posed, 0.5F, cameras), 0.1);
  EXPECT_NEAR(baked.psnr, mean_psnr_of(subject, baked.main, 0.5F, cameras), 0.1);
  EXPECT_GT(baked.psnr, baked.psnr_without + 3);
  EXPECT_EQ(baked.main.sh.dim(1), 16);
  EXPECT_FALSE(baked.main.has_tint());
}

TEST(Bake, ChangesNothingButColours) {
  const Subject subject = subject_to_bake();
  const Surfels posed = posed_main(subject, 0.5F);
  const Baked baked = bake(subject, 0.5F, posed, cameras_beside_each_other(1), nullptr, go_on);
  const auto same = [](const Tensor<float>& a, const Tensor<float>& b) {
    return a.shape() == b.shape() && std::equal(a.data(), a.data() + a.size(), b.data());
  };
  EXPECT_TRUE(same(baked.main.position, posed.position));
  EXPECT_TRUE(same(baked.main.log_scale, posed.log_scale));
  EXPECT_TRUE(same(baked.main.rotation, posed.rotation));
  EXPECT_TRUE(same(baked.main.opacity_logit, posed.opacity_logit));
}

TEST(Bake, GoesOnFromANearbyTime) {
  const Subject subject = subject_to_bake();
  const auto cameras = cameras_beside_each_other(3);
  const Surfels posed = posed_main(subject, 0.5F);
  const Baked first = bake(subject, 0.5F, posed, cameras, nullptr, go_on);
  int64_t images = 0;
  const Baked second = bake(subject, 0.5F, posed, cameras, &first.main.sh, [&](int64_t, int64_t all) {
    images = all;
    return true;
  });
  EXPECT_EQ(images, 6 + 2 * 6);
  EXPECT_GT(second.psnr, first.psnr - 1);
}

TEST(Bake, StopsWhenAskedTo) {
  const Subject subject = subject_to_bake();
  const Surfels posed = posed_main(subject, 0.5F);
  int64_t last = 0;
  const Baked baked =
      bake(subject, 0.5F, posed, cameras_beside_each_other(2), nullptr, [&](int64_t done, int64_t) {
        last = done;
        return done < 3;
      });
  EXPECT_EQ(last, 3);
  EXPECT_EQ(baked.main.count(), posed.count());
}

}  // namespace
}  // namespace traceflow::viz
