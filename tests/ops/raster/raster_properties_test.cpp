#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "base/parallel.h"
#include "raster_scenes.h"

namespace traceflow::raster {
namespace {

constexpr int width = 53;
constexpr int height = 38;

SceneOptions mixed() {
  SceneOptions o;
  o.count = 400;
  o.scale_min = 0.005;
  o.scale_max = 0.5;
  return o;
}

TestScene<float> scene_of(uint64_t seed, const SceneOptions& o = mixed()) {
  return convert_scene<float>(random_scene(seed, width, height, o));
}

struct Result {
  SavedPtr saved = make_saved();
  Output output;
  InputGradient gradient;
};

void run(const TestScene<float>& scene, const Options& options, Result& result) {
  forward(scene.surfels, scene.camera, options, result.output, result.saved.get());
  const auto weights = random_output_gradient<float>(9, scene.camera.width, scene.camera.height);
  backward(scene.surfels, scene.camera, options, *result.saved, weights, result.gradient);
}

bool same_bytes(const Tensor<float>& a, const Tensor<float>& b) {
  return a.shape() == b.shape() &&
         std::memcmp(a.data(), b.data(), static_cast<size_t>(a.size()) * sizeof(float)) == 0;
}

void expect_same_bytes(Result& a, Result& b) {
  const auto x = outputs_of(a.output);
  const auto y = outputs_of(b.output);
  for (size_t i = 0; i < x.size(); ++i) EXPECT_TRUE(same_bytes(*x[i], *y[i])) << output_names[i];
  std::vector<const Tensor<float>*> groups;
  for_each_group(a.gradient.surfels, [&](const char*, const Tensor<float>& g) { groups.push_back(&g); });
  size_t i = 0;
  for_each_group(b.gradient.surfels, [&](const char* name, const Tensor<float>& g) {
    EXPECT_TRUE(same_bytes(*groups[i++], g)) << name;
  });
  EXPECT_TRUE(same_bytes(a.gradient.screen_gradient, b.gradient.screen_gradient));
  EXPECT_EQ(a.gradient.camera.camera_from_world, b.gradient.camera.camera_from_world);
  EXPECT_EQ(a.gradient.camera.position, b.gradient.camera.position);
}

class Orders : public ::testing::TestWithParam<SortOrder> {
 protected:
  void SetUp() override { set_threads(1); }
  Options options() const {
    Options o;
    o.sort = GetParam();
    o.background = {0.2F, 0.4F, 0.6F};
    return o;
  }
};
INSTANTIATE_TEST_SUITE_P(Raster, Orders, ::testing::Values(SortOrder::centre, SortOrder::hit),
                         [](const auto& test) {
                           return std::string(enum_names(test.param)[static_cast<size_t>(test.param)]);
                         });

TEST_P(Orders, give_the_same_bytes_at_any_number_of_threads) {
  SceneOptions many = mixed();
  many.count = 6000;  // more than one part of every stage
  many.scale_max = 0.1;
  const auto scene = scene_of(1, many);
  Result expected;
  set_threads(1);
  run(scene, options(), expected);
  for (const int threads : {2, 3}) {
    set_threads(threads);
    Result found;
    run(scene, options(), found);
    expect_same_bytes(expected, found);
  }
  set_threads(0);
}

TEST_P(Orders, give_the_same_bytes_with_memory_of_another_call) {
  Result reused;
  run(scene_of(2), options(), reused);
  SceneOptions fewer = mixed();
  fewer.count = 50;
  Result fresh;
  run(scene_of(3, fewer), options(), fresh);
  run(scene_of(3, fewer), options(), reused);
  expect_same_bytes(fresh, reused);
}

TEST_P(Orders, do_not_depend_on_the_order_of_the_surfels) {
  const auto scene = scene_of(4);
  const int64_t n = scene.surfels.count();
  std::vector<int64_t> order(static_cast<size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  Random random(5);
  for (int64_t i = n - 1; i > 0; --i)
    std::swap(order[static_cast<size_t>(i)], order[static_cast<size_t>(random.below(i + 1))]);
  auto shuffled = scene;
  std::vector<Tensor<float>*> to;
  for_each_group(shuffled.surfels, [&](const char*, Tensor<float>& t) { to.push_back(&t); });
  const auto shuffle = [&](const auto& from_surfels, auto&& place) {
    size_t group = 0;
    for_each_group(from_surfels, [&](const char*, const Tensor<float>& from) {
      for (int64_t i = 0; i < n; ++i)
        place(group, from.row(order[static_cast<size_t>(i)]), i, from.row_size());
      ++group;
    });
  };
  shuffle(scene.surfels, [&](size_t group, const float* row, int64_t i, int64_t size) {
    std::copy_n(row, size, to[group]->row(i));
  });
  for (int64_t i = 0; i < n; ++i)
    shuffled.surfels.in_body[i] = scene.surfels.in_body[order[static_cast<size_t>(i)]];
  Result a;
  Result b;
  run(scene, options(), a);
  run(shuffled, options(), b);
  const auto x = outputs_of(a.output);
  const auto y = outputs_of(b.output);
  for (size_t i = 0; i < x.size(); ++i) EXPECT_TRUE(same_bytes(*x[i], *y[i])) << output_names[i];
  std::vector<const Tensor<float>*> found;
  for_each_group(b.gradient.surfels, [&](const char*, const Tensor<float>& g) { found.push_back(&g); });
  shuffle(a.gradient.surfels, [&](size_t group, const float* row, int64_t i, int64_t size) {
    EXPECT_TRUE(std::equal(row, row + size, found[group]->row(i))) << "surfel " << i;
  });
}

TEST_P(Orders, a_surfel_without_opacity_is_absent) {
  auto with = scene_of(6);
  auto without = with;
  for (int64_t i = 0; i < with.surfels.count(); i += 2) with.surfels.opacity[i] = 0;
  for (int64_t i = 0; i < with.surfels.count(); i += 2) without.surfels.position(i, 2) = std::nanf("");
  Result a;
  Result b;
  run(with, options(), a);
  run(without, options(), b);
  expect_same_bytes(a, b);
  Tensor<uint8_t> flags;
  visible(*a.saved, flags);
  for (int64_t i = 0; i < flags.size(); i += 2) EXPECT_EQ(flags[i], 0);
}

TEST_P(Orders, alpha_stays_within_zero_and_one) {
  SceneOptions o = mixed();
  o.opacity_max = 3;
  o.depth_min = -1;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Result result;
    run(scene_of(seed, o), options(), result);
    for (const float a : result.output.alpha.values()) {
      EXPECT_GE(a, 0);
      EXPECT_LE(a, 1.0F + 1e-6F);
    }
  }
}

TEST_P(Orders, visible_marks_the_surfels_that_have_a_gradient) {
  Result result;
  run(scene_of(8), options(), result);
  Tensor<uint8_t> flags;
  visible(*result.saved, flags);
  int64_t seen = 0;
  for (int64_t i = 0; i < result.gradient.surfels.count(); ++i) {
    const float g = std::abs(result.gradient.surfels.tint[i]);
    EXPECT_EQ(g != 0, flags[i] != 0) << i;
    seen += flags[i];
  }
  EXPECT_GT(seen, 20);
  EXPECT_LT(seen, result.gradient.surfels.count());
}

// Moving scene and camera together changes nothing but the axes of the normals.
TEST_P(Orders, follow_a_rigid_motion) {
  SceneOptions o = mixed();
  o.sh_degree = 0;
  auto scene = random_scene(7, width, height, o);
  auto moved = scene;
  const Vec4<double> turn = normalize(Vec4<double>(0.5, -0.7, 0.2, 0.4));
  const Mat3<double> r = rotation_from_quaternion(turn);
  const Vec3<double> shift(2, -1, 0.5);
  for (int64_t i = 0; i < scene.surfels.count(); ++i) {
    store3(moved.surfels.position.row(i), r * load3<double>(scene.surfels.position.row(i)) + shift);
    const auto q = load4<double>(scene.surfels.rotation.row(i));
    const Vec3<double> a(turn[1], turn[2], turn[3]);
    const Vec3<double> b(q[1], q[2], q[3]);
    const Vec3<double> v = turn[0] * b + q[0] * a + cross(a, b);
    moved.surfels.rotation(i, 0) = turn[0] * q[0] - dot(a, b);
    for (int k = 0; k < 3; ++k) moved.surfels.rotation(i, k + 1) = v[k];
  }
  moved.camera.camera_from_world = scene.camera.camera_from_world * transpose(r);
  moved.camera.position = r * scene.camera.position + shift;
  Result x;
  Result y;
  run(convert_scene<float>(scene), options(), x);
  run(convert_scene<float>(moved), options(), y);
  int64_t differing = 0;
  for (int64_t i = 0; i < int64_t{width} * height; ++i) {
    const auto normal = Vec3<float>(r * load3<double>(&x.output.normal[3 * i]));
    const bool same =
        length(normal - load3<float>(&y.output.normal[3 * i])) < 2e-4F &&
        std::abs(x.output.alpha[i] - y.output.alpha[i]) < 2e-4F &&
        std::abs(x.output.depth[i] - y.output.depth[i]) < 2e-3F &&
        length(load3<float>(&x.output.colour[3 * i]) - load3<float>(&y.output.colour[3 * i])) < 2e-4F;
    differing += same ? 0 : 1;
  }
  EXPECT_LE(differing, 10);
}

// With colours that do not depend on the direction the signal is the gradient by a shift of the surfel along
// the image.
TEST_P(Orders, screen_gradient_is_by_the_projected_centre) {
  SceneOptions o = mixed();
  o.sh_degree = 0;
  const auto scene = scene_of(10, o);
  Result result;
  run(scene, options(), result);
  for (int64_t i = 0; i < scene.surfels.count(); ++i) {
    const auto centre = scene.camera.point_in_camera(load3<float>(scene.surfels.position.row(i)));
    const auto g = scene.camera.camera_from_world * load3<float>(result.gradient.surfels.position.row(i));
    const float expected = std::hypot(g.x * centre.z / scene.camera.focal_x * width / 2,
                                      g.y * centre.z / scene.camera.focal_y * height / 2);
    EXPECT_NEAR(result.gradient.screen_gradient[i], expected, 1e-3F * (1 + expected)) << i;
  }
}

TEST_P(Orders, survive_hostile_surfels_which_leave_the_others_alone) {
  const float nan = std::nanf("");
  const float infinity = std::numeric_limits<float>::infinity();
  const auto clean = scene_of(11);
  Result expected;
  run(clean, options(), expected);
  // Every value of some surfel in turn, appended behind the clean ones.
  std::vector<float> poison{nan, infinity, -infinity};
  TestScene<float> hostile = clean;
  int64_t extra = 0;
  for_each_input(hostile.surfels, [&](const char*, Tensor<float>& t) { extra += t.row_size(); });
  extra *= static_cast<int64_t>(poison.size());
  const int64_t n = clean.surfels.count();
  std::vector<const Tensor<float>*> from;
  for_each_input(clean.surfels, [&](const char*, const Tensor<float>& t) { from.push_back(&t); });
  size_t group = 0;
  int64_t at = n;
  for_each_input(hostile.surfels, [&](const char*, Tensor<float>& t) {
    const Tensor<float>& source = *from[group++];
    const Shape shape = source.shape();
    t = shape.rank() == 1   ? Tensor<float>({n + extra})
        : shape.rank() == 2 ? Tensor<float>({n + extra, shape[1]})
                            : Tensor<float>({n + extra, shape[1], shape[2]});
    std::copy_n(source.data(), source.size(), t.data());
    for (int64_t i = n; i < n + extra; ++i) std::copy_n(source.row(i % n), t.row_size(), t.row(i));
    for (int64_t k = 0; k < t.row_size(); ++k) {
      for (const float p : poison) t.row(at++)[k] = p;
    }
  });
  ASSERT_EQ(at, n + extra);
  Result found;
  run(hostile, options(), found);
  const auto x = outputs_of(expected.output);
  const auto y = outputs_of(found.output);
  for (size_t i = 0; i < x.size(); ++i) EXPECT_TRUE(same_bytes(*x[i], *y[i])) << output_names[i];
  for (int64_t i = n; i < n + extra; ++i) EXPECT_EQ(found.gradient.surfels.opacity[i], 0) << i;
}

TEST_P(Orders, survive_extreme_surfels) {
  Random random(12);
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    auto scene = scene_of(seed);
    auto& s = scene.surfels;
    const auto extreme = [&] {
      const double sign = random.uniform() < 0.5 ? -1 : 1;
      return static_cast<float>(sign * std::exp(random.uniform(-85, 85)));
    };
    for (int64_t i = 0; i < s.count(); ++i) {
      switch (random.below(6)) {
        case 0:
          s.position(i, random.below(3)) = extreme();
          break;
        case 1:
          s.scale(i, random.below(2)) = extreme();
          break;
        case 2:
          s.rotation(i, random.below(4)) = extreme();
          break;
        case 3:
          std::fill_n(s.rotation.row(i), 4, 0.0F);
          break;
        case 4:
          store3(s.position.row(i), scene.camera.position);
          break;
        default:
          s.scale(i, 0) = 0;
          break;
      }
    }
    Result result;
    run(scene, options(), result);
    for (const float a : result.output.alpha.values()) EXPECT_TRUE(a >= 0 && a <= 1.0F + 1e-6F);
    for (const float c : result.output.colour.values()) EXPECT_TRUE(std::isfinite(c));
  }
}

TEST_P(Orders, draw_nothing_from_nothing) {
  TestScene<float> scene = scene_of(1);
  SceneOptions none;
  none.count = 0;
  scene.surfels = scene_of(1, none).surfels;
  Result result;
  run(scene, options(), result);
  EXPECT_EQ(result.output.colour(3, 4, 1), options().background.y);
  EXPECT_EQ(result.output.alpha(3, 4), 0);
  Tensor<uint8_t> flags;
  visible(*result.saved, flags);
  EXPECT_TRUE(flags.empty());
  scene = scene_of(1);
  scene.camera.width = 0;
  run(scene, options(), result);
  EXPECT_TRUE(result.output.alpha.empty());
}

// The kernels are compiled for several instruction sets; all give the same picture and gradient up to
// rounding.
TEST_P(Orders, agree_on_every_instruction_set) {
  SceneOptions wide = mixed();  // no near ties in depth, which rounding would decide
  wide.count = 60;
  const auto scene = scene_of(13, wide);
  Result expected;
  run(scene, options(), expected);
  const auto supported = hwy::SupportedTargets();
  for (auto rest = supported; rest != 0; rest &= rest - 1) {
    const auto target = rest & -rest;
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    Result found;
    run(scene, options(), found);
    SCOPED_TRACE(hwy::TargetName(target));
    const auto x = outputs_of(expected.output);
    const auto y = outputs_of(found.output);
    for (size_t o = 0; o < x.size(); ++o) {
      int64_t differing = 0;
      for (int64_t i = 0; i < x[o]->size(); ++i)
        differing += std::abs((*x[o])[i] - (*y[o])[i]) > 2e-4F ? 1 : 0;
      EXPECT_LE(differing, 5) << output_names[o];
    }
    const auto& a = expected.gradient.surfels.position;
    const auto& b = found.gradient.surfels.position;
    float largest = 0;
    for (const float v : a.values()) largest = std::max(largest, std::abs(v));
    for (int64_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 1e-3F * largest) << i;
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

TEST(RasterOptions, say_what_is_wrong) {
  const auto rejects = [](auto&& change) {
    Options o;
    change(o);
    EXPECT_THROW(o.validate(), InputError);
  };
  Options().validate();
  rejects([](Options& o) { o.near_plane = 0; });
  rejects([](Options& o) { o.far_plane = o.near_plane; });
  rejects([](Options& o) { o.alpha_min = 0; });
  rejects([](Options& o) { o.alpha_max = 1; });
  rejects([](Options& o) { o.transmittance_min = std::nanf(""); });
  rejects([](Options& o) { o.transmittance_min = 0; });
  rejects([](Options& o) { o.background.y = std::nanf(""); });
}

TEST(RasterInput, that_does_not_fit_together_is_refused) {
  auto scene = scene_of(1);
  Result result;
  run(scene, {}, result);
  auto weights = random_output_gradient<float>(9, width, height);
  weights.depth.resize({3, 3});
  EXPECT_THROW(backward(scene.surfels, scene.camera, {}, *result.saved, weights, result.gradient),
               InternalError);
  scene.surfels.opacity.resize({7});
  EXPECT_THROW(forward(scene.surfels, scene.camera, {}, result.output, nullptr), InternalError);
}

}  // namespace
}  // namespace traceflow::raster
