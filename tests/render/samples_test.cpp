#include "render/samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "render/cloud.h"
#include "support/gradients.h"

namespace traceflow {
namespace {

using testing::random_tensor;

constexpr int per_side = 3;

std::vector<Tensor<float>*> layers_of(auto& o) {
  return {&o.colour, &o.alpha, &o.tint,         &o.silhouette, &o.roughness,
          &o.normal, &o.depth, &o.median_depth, &o.distortion};
}

raster::Output random_layers(int64_t height, int64_t width, Random& random) {
  raster::Output o;
  for (Tensor<float>* layer : layers_of(o)) {
    const bool vectors = layer == &o.colour || layer == &o.normal;
    const Shape shape = vectors ? Shape{height, width, 3} : Shape{height, width};
    *layer = random_tensor<float>(shape, random, 0.2, 1);
  }
  return o;
}

// A picture of several samples a pixel is the mean of pictures whose pixels lie between, reflections and all.
TEST(Samples, AreTheMeanOfPicturesThatLieBetween) {
  const Fixture f;
  RenderOptions options;
  options.low_pass = false;  // it is as wide as a sample
  Tensor<float> mean({f.request.camera.height, f.request.camera.width, 3});
  for (int k = 0; k < per_side * per_side; ++k) {
    FrameRequest moved = f.request;
    moved.camera.centre_x += (1 - static_cast<float>(k % per_side)) / per_side;
    moved.camera.centre_y += (1 - static_cast<float>(k / per_side)) / per_side;
    const Tensor<float> colour = Renderer(options).forward(f.scene, moved).colour;
    for (int64_t i = 0; i < mean.size(); ++i) mean[i] += colour[i] / (per_side * per_side);
  }
  options.samples = per_side;
  Renderer renderer(options);
  const Frame& frame = renderer.forward(f.scene, f.request);
  ASSERT_EQ(frame.colour.shape(), mean.shape());
  double error = 0, change = 0;
  options.samples = 1;
  const Tensor<float> one = Renderer(options).forward(f.scene, f.request).colour;
  for (int64_t i = 0; i < mean.size(); ++i) {
    error += std::abs(frame.colour[i] - mean[i]);
    change += std::abs(one[i] - mean[i]);
  }
  EXPECT_LT(error, 1e-3 * change);
}

TEST(Samples, AreAsManyForAnAngleAsInTraining) {
  Camera<float> camera;
  camera.focal_y = 1e6F;
  for (const auto& [focal, samples] :
       {std::pair{50, 4}, {100, 4}, {150, 3}, {200, 2}, {215, 2}, {400, 1}, {4000, 1}}) {
    camera.focal_x = static_cast<float>(focal);
    EXPECT_EQ(samples::samples_for(camera, 2, 200, 4), samples) << focal;
    EXPECT_EQ(samples::samples_for(camera, 2, 200, 1), 1);
    EXPECT_EQ(samples::samples_for(camera, 2, 0, 4), 2) << "nobody knows the trained focal length";
  }
  camera.focal_x = 100;
  EXPECT_EQ(samples::samples_for(camera, 1, 200, 4), 2) << "half as large as the photographs";
}

// Three times as large, a picture has those of the size of training at the middle of each 3x3 pixels: surfels
// smaller than a pixel are drawn as large for the eye.
TEST(Samples, ALargerPictureHasThePixelsOfATrainedOne) {
  Fixture f;
  f.scene.main.log_scale.fill(std::log(0.001F));  // a fortieth of a pixel where most stand
  f.scene.focal = f.request.camera.focal_x;
  const Tensor<float> trained = Renderer(RenderOptions{}).forward(f.scene, f.request).colour;
  f.request.camera = samples::camera_of(f.request.camera, 3);
  f.request.cull = true;
  const Tensor<float> larger = Renderer(RenderOptions{}).forward(f.scene, f.request).colour;
  float largest = 0;
  for (int64_t y = 0; y < trained.dim(0); ++y) {
    for (int64_t x = 0; x < trained.dim(1); ++x) {
      for (int64_t c = 0; c < 3; ++c) {
        ASSERT_NEAR(larger(3 * y + 1, 3 * x + 1, c), trained(y, x, c), 2e-4) << x << ", " << y;
        largest = std::max(largest, trained(y, x, c));
      }
    }
  }
  EXPECT_GT(largest, 0.2);
}

// Trained pictures have the options' samples whatever the camera; others as many for an angle.
TEST(Samples, OfPicturesFollowTheFocalLength) {
  Fixture f;
  f.scene.focal = 2 * f.request.camera.focal_x;
  Renderer renderer{RenderOptions{}};
  EXPECT_EQ(renderer.forward(f.scene, f.request, true).samples, 1);
  EXPECT_EQ(renderer.forward(f.scene, f.request).samples, 2);
  RenderOptions two;
  two.samples = 2;
  f.request.most_samples = 2;
  const Tensor<float> as_trained = Renderer(two).forward(f.scene, f.request, true).colour;
  EXPECT_TRUE(std::ranges::equal(as_trained.values(), renderer.forward(f.scene, f.request).colour.values()));
}

TEST(Samples, TheirGradientAgreesWithCentralDifferences) {
  Random random(4);
  raster::Output samples = random_layers(2 * per_side, 4 * per_side, random), picture;
  samples.median_depth[5] = samples.median_depth[7] = 0;  // as where nothing is opaque
  samples::average(samples, per_side, picture);
  raster::OutputGradient by_picture, gradient;
  const auto of_picture = layers_of(picture), weights = layers_of(by_picture);
  for (size_t k = 0; k < weights.size(); ++k)
    *weights[k] = random_tensor<float>(of_picture[k]->shape(), random, -1, 1);
  samples::average_backward(samples, picture, per_side, by_picture, gradient);

  const auto of_samples = layers_of(samples), found = layers_of(gradient);
  const auto value = [&] {
    samples::average(samples, per_side, picture);
    double sum = 0;
    for (size_t k = 0; k < weights.size(); ++k) sum += testing::dot(*weights[k], *of_picture[k]);
    return sum;
  };
  for (size_t k = 0; k < found.size(); ++k) {
    Tensor<double> expected = testing::central_differences(*of_samples[k], value, 0.01);
    for (int64_t i = 0; i < expected.size(); ++i) {
      if ((*of_samples[k])[i] == 0) expected[i] = 0;
    }
    testing::expect_close(*found[k], expected, 1e-3, std::to_string(k).c_str());
  }
}

TEST(Samples, WhatHasNoGradientGetsNone) {
  Random random(5);
  const raster::Output samples = random_layers(per_side, per_side, random);
  raster::Output picture;
  samples::average(samples, per_side, picture);
  raster::OutputGradient by_picture, gradient;
  by_picture.colour = random_tensor<float>(picture.colour.shape(), random, -1, 1);
  samples::average_backward(samples, picture, per_side, by_picture, gradient);
  for (const Tensor<float>* layer : layers_of(gradient)) EXPECT_EQ(layer->empty(), layer != &gradient.colour);
}

// Where nothing is drawn.
TEST(Samples, OfNothingHaveNoDepth) {
  raster::Output samples, picture;
  for (Tensor<float>* layer : layers_of(samples)) {
    const bool vectors = layer == &samples.colour || layer == &samples.normal;
    layer->reset(vectors ? Shape{per_side, per_side, 3} : Shape{per_side, per_side});
  }
  samples::average(samples, per_side, picture);
  raster::OutputGradient by_picture, gradient;
  for (Tensor<float>* layer : {&by_picture.depth, &by_picture.median_depth}) {
    layer->reset({1, 1});
    layer->fill(1);
  }
  samples::average_backward(samples, picture, per_side, by_picture, gradient);
  EXPECT_EQ(picture.depth[0], 0);
  EXPECT_EQ(picture.median_depth[0], 0);
  for (const Tensor<float>* layer : {&gradient.depth, &gradient.median_depth, &gradient.alpha}) {
    for (const float v : layer->values()) EXPECT_EQ(v, 0);
  }
}

}  // namespace
}  // namespace traceflow
