#include "render/renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "render/cloud.h"
#include "render/frame_kernels.h"
#include "render/visibility.h"

namespace traceflow {
namespace {

void expect_equal(const Tensor<float>& a, const Tensor<float>& b, const char* name) {
  ASSERT_EQ(a.size(), b.size()) << name;
  for (int64_t i = 0; i < a.size(); ++i) ASSERT_EQ(a[i], b[i]) << name << " " << i;
}

void expect_near(const Tensor<float>& a, const Tensor<float>& b, float tolerance, const char* name) {
  ASSERT_EQ(a.size(), b.size()) << name;
  for (int64_t i = 0; i < a.size(); ++i)
    ASSERT_NEAR(a[i], b[i], tolerance * (1 + std::abs(b[i]))) << name << " " << i;
}

TEST(ConeWidths, GradientAgreesWithCentralDifferences) {
  const int32_t pixel = 0;
  const float roughness = 0.2F, alpha = 0.8F, step = 1e-3F, grad_width = 3;
  const auto width_of = [&](float r, float a) {
    float width = 0;
    ConeWidths{&pixel, &r, &a, &width}(0);
    return width;
  };
  const float width = width_of(roughness, alpha);
  float by_roughness = 0, by_alpha = 0;
  ConeWidthsBackward{&pixel, &alpha, &width, &grad_width, &by_roughness, &by_alpha}(0);
  const auto slope = [&](float high, float low) { return grad_width * (high - low) / (2 * step); };
  EXPECT_NEAR(by_roughness, slope(width_of(roughness + step, alpha), width_of(roughness - step, alpha)),
              1e-3);
  EXPECT_NEAR(by_alpha, slope(width_of(roughness, alpha + step), width_of(roughness, alpha - step)), 1e-3);
}

TEST(Visibility, AllowsForTheLargestDisplacement) {
  Fixture f;
  const Camera<float>& camera = f.request.camera;
  const Vec3<float> aside = camera.position + Vec3<float>(-10, 0, 3) * camera.camera_from_world;
  for (int64_t i = 0; i < f.scene.main.count(); ++i) store3(f.scene.main.position.row(i), aside);
  f.scene.main.log_scale.fill(-5);
  Tensor<float> moved({1});
  for (const float far : {1.0F, 20.0F}) {
    moved[0] = far;
    EXPECT_EQ(surfels_in_view(f.scene.main, camera, 0.01F, moved.data()).size(),
              far > 10 ? f.scene.main.count() : 0);
  }
}

TEST(Renderer, CullingChangesNoPixel) {
  Fixture f;
  Renderer renderer(RenderOptions{});
  const Frame& whole = renderer.forward(f.scene, f.request);
  const Tensor<float> colour = whole.colour;
  const Tensor<float> depth = whole.raster.depth;
  f.scene.main_max_displacement = whole.max_displacement;
  f.request.cull = true;
  const Frame& culled = renderer.forward(f.scene, f.request);
  ASSERT_LT(culled.main.count(), f.scene.main.count() * 9 / 10) << "the view leaves something out";
  expect_equal(colour, culled.colour, "colour");
  expect_equal(depth, culled.raster.depth, "depth");
}

// A mirror of sheet metal shows the mean of what a perfect one shows round about: bright and dark spots fade.
TEST(Renderer, RoughMirrorsBlur) {
  Fixture f;
  const auto spread_of = [&] {
    Renderer renderer(RenderOptions{});
    const Tensor<float>& seen = renderer.forward(f.scene, f.request).specular_rays;
    double sum = 0, squares = 0;
    for (const float v : seen.values()) {
      sum += v;
      squares += double{v} * v;
    }
    const auto n = static_cast<double>(seen.size());
    EXPECT_GT(n, 300);
    return squares / n - sum * sum / (n * n);
  };
  f.scene.environment.log_scale.fill(std::log(0.1F));
  const double perfect = spread_of();
  f.scene.main.roughness_logit.reset({f.scene.main.count()});
  f.scene.main.roughness_logit.fill(-6);
  EXPECT_NEAR(spread_of(), perfect, 0.05 * perfect);
  f.scene.main.roughness_logit.fill(2);
  EXPECT_LT(spread_of(), 0.5 * perfect);
}

// Below a pixel a surfel shows as far as its low pass does.
TEST(Renderer, CullingKeepsWhatIsSmallerThanAPixel) {
  Fixture f;
  Random random(5);
  f.scene.main = scattered(20000, 1.2F, true, random);
  f.scene.main.log_scale.fill(std::log(1e-4F));
  f.scene.main.opacity_logit.fill(3);
  f.scene.main_field.reset();
  Renderer renderer(RenderOptions{});
  const Tensor<float> colour = renderer.forward(f.scene, f.request).colour;
  f.request.cull = true;
  const Frame& culled = renderer.forward(f.scene, f.request);
  ASSERT_LT(culled.main.count(), f.scene.main.count() * 9 / 10);
  expect_equal(colour, culled.colour, "colour");
}

void expect_same_frame(const Frame& found, const Frame& expected) {
  expect_equal(found.colour, expected.colour, "colour");
  expect_equal(found.raster.colour, expected.raster.colour, "diffuse");
  expect_equal(found.raster.tint, expected.raster.tint, "tint");
  expect_equal(found.raster.roughness, expected.raster.roughness, "roughness");
  expect_equal(found.raster.normal, expected.raster.normal, "normal");
  expect_equal(found.raster.depth, expected.raster.depth, "depth");
  expect_equal(found.raster.distortion, expected.raster.distortion, "distortion");
  expect_equal(found.main.position, expected.main.position, "main");
  expect_equal(found.specular_rays, expected.specular_rays, "specular");
  expect_equal(found.mirrored.distance, expected.mirrored.distance, "distance");
  expect_equal(found.max_displacement, expected.max_displacement, "reach");
}

// What a viewer asks for, one after another: every frame is what a renderer without memory makes.
void expect_reuse_changes_nothing(const Fixture& f) {
  Renderer reusing(RenderOptions{});
  FrameRequest request = f.request;
  const auto look = [&](bool for_backward = false) {
    SCOPED_TRACE(request.time);
    const Frame& found = reusing.forward(f.scene, request, for_backward);
    FrameRequest anew = request;
    anew.reuse_pose = false;
    Renderer fresh(RenderOptions{});
    expect_same_frame(found, fresh.forward(f.scene, anew));
  };
  request.reuse_pose = true;
  look();
  request.camera.position.x = 0.4F;
  look();
  request.time = 0.2F;
  look();
  request.specular = false;
  look();
  request.time = 0.9F;
  look();
  request.specular = true;  // at a time at which the environment was never posed
  look();
  request.sh_degree_main = request.sh_degree_environment = 0;
  look();
  request.deform_main = request.deform_environment = false;
  look();
  request.cull = true;
  look();
  request.cull = false;
  look();
  look(true);
  request.camera.position.y = -0.3F;
  look();
}

TEST(Renderer, ReusingAPoseChangesNothing) {
  Fixture f;
  f.scene.main_max_displacement[0] = 1;
  expect_reuse_changes_nothing(f);
  Random random(8);
  NetworkOptions network;
  network.width = 16;
  network.depth = 2;
  network.skip = 0;
  f.scene.environment_field = make_field(network, residual::environment_outputs, random);
  for (float& v : f.scene.environment_field->head_weight.values())
    v = 0.05F * static_cast<float>(random.normal());
  expect_reuse_changes_nothing(f);
  f.scene.main_field.reset();
  expect_reuse_changes_nothing(f);
}

TEST(Renderer, ReusingAPoseLeavesGradientsWhole) {
  Fixture f;
  f.request.reuse_pose = true;
  Renderer looked(RenderOptions{}), fresh(RenderOptions{});
  FrameRequest before = f.request;
  before.time = 0.1F;
  looked.forward(f.scene, before, true);
  looked.forward(f.scene, f.request);
  const auto gradient_of = [&](Renderer& renderer) {
    const Frame& frame = renderer.forward(f.scene, f.request, true);
    FrameGradient grad_frame;
    grad_frame.colour.reset(frame.colour.shape());
    grad_frame.colour.fill(1);
    SceneGradient gradient;
    gradient.reset(f.scene);
    renderer.backward(f.scene, f.request, Trainable{}, grad_frame, gradient);
    return gradient.main_field.head_weight;
  };
  expect_equal(gradient_of(looked), gradient_of(fresh), "field");
}

TEST(Renderer, APoseIsReusedOnlyWhereAskedFor) {
  Fixture f;
  Renderer renderer(RenderOptions{});
  renderer.forward(f.scene, f.request);
  f.scene.main.sh.fill(1);
  f.scene.environment.sh.fill(2);
  FrameRequest reuse = f.request;
  reuse.reuse_pose = true;
  Renderer fresh(RenderOptions{});
  const Tensor<float> expected = fresh.forward(f.scene, f.request).colour;
  EXPECT_NE(renderer.forward(f.scene, reuse).colour[3000], expected[3000]) << "the promise was broken";
  // A frame without reflections in between, of another scene, leaves nothing of the first one's.
  FrameRequest diffuse = f.request;
  diffuse.specular = false;
  renderer.forward(f.scene, diffuse);
  expect_equal(renderer.forward(f.scene, reuse).colour, expected, "colour");
}

TEST(Renderer, TheReachGrowsAtOnceAndShrinksSlowly) {
  float found = 2, max_displacement = 1;
  const FollowMaxDisplacement follow{&found, &max_displacement};
  follow(0);
  EXPECT_EQ(max_displacement, 2);
  found = 0.5F;
  follow(0);
  EXPECT_EQ(max_displacement, 0.995F * 2);
}

TEST(Renderer, AGradientOfPosedPositionsReachesTheStoredOnes) {
  Fixture f;
  f.request.cull = true;
  f.request.deform_main = false;
  Renderer renderer(RenderOptions{});
  const Frame& frame = renderer.forward(f.scene, f.request, true);
  ASSERT_LT(frame.subset.size(), 600);
  FrameGradient grad_frame;
  grad_frame.colour.reset(frame.colour.shape());
  grad_frame.main_position.reset(frame.main.position.shape());
  Random random(4);
  for (float& v : grad_frame.main_position.values()) v = static_cast<float>(random.normal());
  SceneGradient gradient;
  gradient.reset(f.scene);
  renderer.backward(f.scene, f.request, Trainable{}, grad_frame, gradient);
  Tensor<float> expected(f.scene.main.position.shape());
  for (int64_t i = 0; i < frame.subset.size(); ++i) {
    std::copy_n(grad_frame.main_position.row(i), 3, expected.row(frame.subset[i]));
  }
  expect_equal(gradient.main.position, expected, "position");
}

// Light that changes reaches the picture at its time alone, and the picture's gradient reaches it.
TEST(Renderer, LightThatChangesIsSeenAndLearned) {
  Fixture f;
  f.request.specular = false;
  Random random(9);
  Lighting lighting;
  lighting.box.reset({2, 3});
  lighting.time = tensor_of(std::vector<float>{0, 0.6F, 1});
  lighting.brightness.reset({3, 4, 4, 4});
  for (int64_t axis = 0; axis < 3; ++axis) {
    lighting.box(0, axis) = -2;
    lighting.box(1, axis) = 2;
  }
  std::vector<int64_t> inner;  // at the second time
  for (int64_t i = 64; i < 128; ++i) {
    const int64_t x = i % 4, y = i / 4 % 4, z = i / 16 % 4;
    if (std::min({x, y, z}) > 0 && std::max({x, y, z}) < 3) inner.push_back(i);
  }
  for (const int64_t i : inner) lighting.brightness[i] = 0.3F * static_cast<float>(random.normal());
  Renderer renderer(RenderOptions{});
  const Tensor<float> plain = renderer.forward(f.scene, f.request).colour;
  f.scene.lighting = lighting;
  FrameRequest first = f.request;
  first.time = 0;
  const Tensor<float> then = renderer.forward(f.scene, first).colour;
  f.scene.lighting.reset();
  expect_equal(then, renderer.forward(f.scene, first).colour, "where the brightness is 1");

  f.scene.lighting = lighting;
  FrameGradient by_frame;
  by_frame.colour.resize(plain.shape());
  for (float& v : by_frame.colour.values()) v = static_cast<float>(random.normal());
  const auto loss = [&] {
    const Tensor<float> colour = renderer.forward(f.scene, f.request).colour;
    double sum = 0;
    for (int64_t i = 0; i < colour.size(); ++i) sum += static_cast<double>(by_frame.colour[i]) * colour[i];
    return sum;
  };
  const Tensor<float> lit = renderer.forward(f.scene, f.request, true).colour;
  EXPECT_FALSE(std::equal(lit.data(), lit.data() + lit.size(), plain.data()));
  SceneGradient gradient;
  gradient.reset(f.scene);
  renderer.backward(f.scene, f.request, Trainable{}, by_frame, gradient);
  double most = 0;
  for (const float by : gradient.lighting.brightness.values()) most = std::max(most, std::abs(double{by}));
  ASSERT_GT(most, 0.1);
  for (const int64_t i : inner) {
    constexpr float step = 4e-3F;
    float& value = f.scene.lighting->brightness[i];
    const float before = value;
    value = before + step;
    const double above = loss();
    value = before - step;
    const double below = loss();
    value = before;
    EXPECT_NEAR(gradient.lighting.brightness[i], (above - below) / (2 * step), 5e-3 * most) << i;
  }
  for (int64_t i = 0; i < 64; ++i) EXPECT_EQ(gradient.lighting.brightness[i], 0);
  Trainable frozen;
  frozen.lighting = false;
  gradient.reset(f.scene);
  renderer.forward(f.scene, f.request, true);
  renderer.backward(f.scene, f.request, frozen, by_frame, gradient);
  for (const float by : gradient.lighting.brightness.values()) EXPECT_EQ(by, 0);
}

// The silhouette is what the tint shows where bodies' surfels are white and the others black.
TEST(Renderer, TheSilhouetteIsWhatBodiesCover) {
  Fixture f;
  f.scene.main.body.reset({f.scene.main.count()});
  for (int64_t i = 0; i < f.scene.main.count(); ++i) {
    f.scene.main.body[i] = static_cast<int32_t>(i % 3) - 1;
    f.scene.main.tint_logit[i] = f.scene.main.body[i] >= 0 ? 100.0F : -100.0F;
  }
  f.scene.main_field.reset();
  Renderer renderer(RenderOptions{});
  EXPECT_TRUE(renderer.forward(f.scene, f.request).raster.silhouette.empty()) << "nobody asked";
  f.request.silhouette = f.request.cull = true;
  const Frame& frame = renderer.forward(f.scene, f.request);
  ASSERT_LT(frame.main.count(), f.scene.main.count()) << "the view leaves something out";
  const Tensor<float> silhouette = frame.raster.silhouette;
  expect_near(silhouette, frame.raster.tint, 1e-6F, "silhouette");
  EXPECT_GT(*std::ranges::max_element(silhouette.values()), 0.5F);
  f.request.silhouette = false;
  EXPECT_TRUE(renderer.forward(f.scene, f.request).raster.silhouette.empty());
}

// Where everything belongs to a body, the silhouette is the picture's alpha, and so are their gradients.
TEST(Renderer, TheGradientOfASilhouetteOfAllIsThatOfAlpha) {
  Fixture f;
  f.request.silhouette = true;
  f.scene.main.body.reset({f.scene.main.count()});
  Renderer renderer(RenderOptions{});
  const auto gradient_of = [&](Tensor<float> FrameGradient::*layer) {
    const Frame& frame = renderer.forward(f.scene, f.request, true);
    FrameGradient grad_frame;
    grad_frame.colour.reset(frame.colour.shape());
    Random random(4);
    (grad_frame.*layer).reset(frame.raster.alpha.shape());
    for (float& v : (grad_frame.*layer).values()) v = static_cast<float>(random.normal());
    SceneGradient gradient;
    gradient.reset(f.scene);
    renderer.backward(f.scene, f.request, Trainable{}, grad_frame, gradient);
    return gradient;
  };
  const SceneGradient found = gradient_of(&FrameGradient::silhouette);
  const SceneGradient expected = gradient_of(&FrameGradient::alpha);
  EXPECT_GT(*std::ranges::max_element(expected.main.position.values()), 0.1F);
  expect_near(found.main.position, expected.main.position, 1e-4F, "position");
  expect_near(found.main.log_scale, expected.main.log_scale, 1e-4F, "scale");
  expect_near(found.main.opacity_logit, expected.main.opacity_logit, 1e-4F, "opacity");
}

TEST(Renderer, DensityControlIsToldNormsOfWhatWasDrawn) {
  Fixture f;
  f.request.cull = true;
  Renderer renderer(RenderOptions{});
  const Frame& frame = renderer.forward(f.scene, f.request, true);
  FrameGradient grad_frame;
  Random random(6);
  grad_frame.colour.reset(frame.colour.shape());
  for (float& v : grad_frame.colour.values()) v = static_cast<float>(random.normal());
  SceneGradient gradient;
  gradient.reset(f.scene);
  renderer.backward(f.scene, f.request, Trainable{}, grad_frame, gradient);
  int64_t main = 0, environment = 0;
  for (int64_t i = 0; i < f.scene.main.count(); ++i) {
    ASSERT_GE(gradient.main_signal[i], 0);
    if (gradient.main_signal[i] > 0) ++main;
    ASSERT_TRUE(gradient.main_visible[i] != 0 || gradient.main_signal[i] == 0);
  }
  for (int64_t i = 0; i < f.scene.environment.count(); ++i) {
    ASSERT_GE(gradient.environment_signal[i], 0);
    if (gradient.environment_signal[i] > 0) ++environment;
    ASSERT_EQ(gradient.environment_visible[i] != 0, gradient.environment_signal[i] > 0);
  }
  EXPECT_GT(main, 100);
  EXPECT_GT(environment, 10);
}

TEST(Renderer, WithoutReflectionsTheImageIsTheDiffuseOne) {
  Fixture f;
  f.request.specular = false;
  Renderer renderer(RenderOptions{});
  const Frame& frame = renderer.forward(f.scene, f.request);
  EXPECT_TRUE(frame.traced.pixel.empty());
  expect_equal(frame.colour, frame.raster.colour, "colour");
}

TEST(Renderer, SkippingPixelsThatDoNotReflectChangesTheImageByLessThanHalfAStep) {
  // method §4.4: the default thresholds move no pixel by more than 1/512.
  Fixture f;
  Random random(9);
  for (float& v : f.scene.main.tint_logit.values()) v = static_cast<float>(random.uniform(-12, 0));
  RenderOptions all;
  all.select.min_alpha = all.select.min_tint = 0;
  Renderer exact(all);
  Renderer skipping(RenderOptions{});
  const Tensor<float> expected = exact.forward(f.scene, f.request).colour;
  const Frame& frame = skipping.forward(f.scene, f.request);
  EXPECT_LT(frame.traced.pixel.size(), 64 * 48);
  for (int64_t i = 0; i < expected.size(); ++i)
    ASSERT_NEAR(frame.colour[i], expected[i], 1.0F / 512 + 1e-6F) << i;
}

TEST(Renderer, ColourIsTheBlendOfItsLayers) {
  // method §6 on every pixel that was traced.
  Fixture f;
  Renderer renderer(RenderOptions{});
  const Frame& frame = renderer.forward(f.scene, f.request);
  const Tensor<float> specular = frame.specular_image();
  ASSERT_FALSE(frame.traced.pixel.empty());
  for (const int32_t p : frame.traced.pixel.values()) {
    for (int64_t c = 0; c < 3; ++c) {
      const int64_t i = 3 * int64_t{p} + c;
      const float a = frame.raster.tint[p];
      ASSERT_NEAR(frame.colour[i], (1 - a) * frame.raster.colour[i] + a * specular[i], 1e-5F);
    }
  }
}

// Of whoever wants no ray cut.
TEST(Renderer, ARayMayGoOnForAsLongAsNumbersReach) {
  Fixture f;
  const Tensor<float> cut = Renderer(RenderOptions{}).forward(f.scene, f.request).colour;
  RenderOptions options;
  options.raster.transmittance_min = 0;
  options.validate();
  const Tensor<float> whole = Renderer(options).forward(f.scene, f.request).colour;
  float most = 0;
  for (int64_t i = 0; i < cut.size(); ++i) most = std::max(most, std::abs(cut[i] - whole[i]));
  EXPECT_LT(most, 5e-3F);
  for (const float refused : {-1e-9F, 1.0F, std::nanf("")}) {
    options.raster.transmittance_min = refused;
    EXPECT_THROW(options.validate(), InputError);
  }
}

// What is drawn keeps its own threshold.
TEST(Renderer, FaintReflectedHitsAreSkippedByTheirOwnThreshold) {
  Fixture f;
  RenderOptions options;
  const Frame all = Renderer(options).forward(f.scene, f.request);
  options.trace.alpha_min = 0.1F;
  options.validate();
  const Frame fewer = Renderer(options).forward(f.scene, f.request);
  expect_equal(all.raster.colour, fewer.raster.colour, "diffuse");
  const Tensor<float>&before = all.mirrored.alpha, &after = fewer.mirrored.alpha;
  ASSERT_EQ(before.size(), after.size());
  int64_t less = 0;
  for (int64_t i = 0; i < before.size(); ++i) {
    EXPECT_LE(after[i], before[i] + options.raster.transmittance_min);
    less += after[i] < before[i] - 0.01F ? 1 : 0;
  }
  EXPECT_GT(less, before.size() / 10);
  for (const float refused : {0.0F, options.raster.alpha_max, std::nanf("")}) {
    options.trace.alpha_min = refused;
    EXPECT_THROW(options.validate(), InputError);
  }
}

TEST(Renderer, AnEmptyViewIsBackground) {
  Fixture f;
  f.request.camera.position = {0, 0, 50};
  f.request.cull = true;
  RenderOptions options;
  options.raster.background = {0.2F, 0.4F, 0.6F};
  Renderer renderer(options);
  const Frame& frame = renderer.forward(f.scene, f.request, true);
  for (int64_t i = 0; i < frame.raster.alpha.size(); ++i) ASSERT_FLOAT_EQ(frame.colour[3 * i + 2], 0.6F);
  FrameGradient grad;
  grad.colour.reset(frame.colour.shape());
  grad.colour.fill(1);
  SceneGradient gradient;
  gradient.reset(f.scene);
  renderer.backward(f.scene, f.request, Trainable{}, grad, gradient);
  gradient.main.for_each([](const std::string& name, const Tensor<float>& t) {
    for (const float v : t.values()) ASSERT_EQ(v, 0) << name;
  });
}

TEST(Renderer, SameBytesAtAnyThreadCount) {
  Fixture f;
  Tensor<float> colour[2];
  Tensor<float> gradient_of_position[2];
  for (int threads = 1; threads <= 2; ++threads) {
    set_threads(threads);
    Renderer renderer(RenderOptions{});
    const Frame& frame = renderer.forward(f.scene, f.request, true);
    colour[threads - 1] = frame.colour;
    FrameGradient grad;
    grad.colour = frame.colour;
    SceneGradient gradient;
    gradient.reset(f.scene);
    renderer.backward(f.scene, f.request, Trainable{}, grad, gradient);
    gradient_of_position[threads - 1] = gradient.main.position;
  }
  set_threads(0);
  expect_equal(colour[0], colour[1], "colour");
  expect_equal(gradient_of_position[0], gradient_of_position[1], "gradient");
}

}  // namespace
}  // namespace traceflow
