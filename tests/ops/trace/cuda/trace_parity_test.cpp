#include "ops/trace/trace_device_run.h"
#include "ops/trace/trace_usable.h"

namespace traceflow::trace {
namespace {

using namespace traceflow::testing;

using TraceOnDevice = OnDevice;

// Some rays have more hits than are held at a time.
TEST_F(TraceOnDevice, AgreesWithTheCpuAtEveryDegree) {
  for (int degree = 0; degree <= 3; ++degree) {
    const TestScene scene = smooth_scene(static_cast<uint64_t>(degree), degree, 120, 150);
    const Traced expected = trace(scene, smooth_options());
    EXPECT_GT(expected.hits, 20 * 150);
    for (const bool in_order : {false, true}) {
      SCOPED_TRACE(::testing::Message() << "degree " << degree << (in_order ? " in order" : ""));
      const InOrder order(in_order);
      expect_same(trace_on_device(scene, smooth_options()), expected);
    }
  }
}

TEST_F(TraceOnDevice, AgreesWithTheCpuWithCones) {
  for (const double width : {0.02, 0.3}) {
    TestScene scene = random_scene(
        9, {.surfels = 120, .rays = 150, .sh_degree = 2, .opacity_max = 0.5, .width_max = width});
    const Traced expected = trace(scene, smooth_options());
    for (const bool in_order : {false, true}) {
      const InOrder order(in_order);
      expect_same(trace_on_device(scene, smooth_options()), expected);
    }
  }
}

// Whether single precision may take this ray either way: a hit near the cut-off, a ray near its end, or two
// hits at almost one distance.
bool is_at_boundary(const TestScene& scene, const Options& options, int64_t ray) {
  struct Hit {
    double distance, alpha;
  };
  std::vector<Hit> hits;
  const Vec3<double> origin = load3<double>(scene.rays.origins.row(ray));
  const Vec3<double> direction = glm::normalize(load3<double>(scene.rays.directions.row(ray)));
  const auto surfels = convert<double>(scene.surfels);
  constexpr double near = 1e-4;
  for (int64_t i = 0; i < surfels.count(); ++i) {
    const auto hit = intersect(SurfelView<double>(surfels).frame(i), origin, direction);
    const double alpha = surfels.opacity[i] * std::exp(-0.5 * (hit.u * hit.u + hit.v * hit.v));
    if (!hit.valid || hit.t < (1 - near) * options.t_min || alpha < (1 - near) * options.alpha_min) continue;
    if (alpha < (1 + near) * options.alpha_min || hit.t < (1 + near) * options.t_min) return true;
    hits.push_back({hit.t, std::min(alpha, static_cast<double>(options.alpha_max))});
  }
  std::sort(hits.begin(), hits.end(), [](const Hit& a, const Hit& b) { return a.distance < b.distance; });
  double transmittance = 1;
  for (size_t i = 0; i < hits.size(); ++i) {
    transmittance *= 1 - hits[i].alpha;
    if (i > 0 && hits[i].distance - hits[i - 1].distance < 1e-5 * hits[i].distance) return true;
    if (std::abs(transmittance - options.transmittance_min) < near * options.transmittance_min) return true;
    if (transmittance < options.transmittance_min) return false;
  }
  return false;
}

// Rays that differ are few, and each is at a boundary.
void expect_same_but_at_boundaries(const TestScene& scene, const Options& options) {
  const Traced expected = trace(scene, options), found = trace_on_device(scene, options);
  const int64_t rays = scene.rays.count();
  int64_t different = 0;
  for (int64_t r = 0; r < rays; ++r) {
    bool same = std::abs(found.output.alpha[r] - expected.output.alpha[r]) < 1e-5F &&
                std::abs(found.output.distance[r] - expected.output.distance[r]) < 1e-4F;
    for (int c = 0; c < 3; ++c) {
      same = same && std::abs(found.output.colour(r, c) - expected.output.colour(r, c)) < 1e-5F;
    }
    if (same) continue;
    ++different;
    EXPECT_TRUE(is_at_boundary(scene, options, r)) << r;
  }
  EXPECT_LE(different, rays / 50);
  EXPECT_TRUE(all_finite(found));
}

TEST_F(TraceOnDevice, AgreesWithTheCpuWithinThresholds) {
  SceneOptions o{.surfels = 1500, .rays = 300, .scale_min = 0.02, .scale_max = 0.2, .opacity_min = 0};
  expect_same_but_at_boundaries(random_scene(1, o), {});
  o.ray_distance = 0.3;
  Options from_inside;
  from_inside.t_min = 0.1F;
  expect_same_but_at_boundaries(random_scene(2, o), from_inside);
}

// Where each ray ends among the first of the hits that are held.
TEST_F(TraceOnDevice, AgreesWithTheCpuWhereEveryRayEndsEarly) {
  const SceneOptions o{.surfels = 2000, .rays = 300, .sh_degree = 1, .opacity_min = 0.9, .opacity_max = 1.0};
  Options options;
  options.background = {0.1F, 0.2F, 0.3F};
  expect_same_but_at_boundaries(random_scene(3, o), options);
}

// Many times more hits on a ray than are held, from either side, and as many at one distance: those blend in
// the order of their index.
TEST_F(TraceOnDevice, AnyNumberOfHits) {
  constexpr int64_t count = 2000;
  TestScene scene = blank_scene(count, 0, 40);
  Random random(7);
  for (int64_t i = 0; i < count; ++i) {
    set_facing(scene.surfels, i, i < 100 ? 5 : 1 + 0.005F * static_cast<float>(i), 1, 0.004F);
    for (int c = 0; c < 3; ++c) scene.surfels.sh.row(i)[c] = static_cast<float>(random.normal());
  }
  for (int64_t r = 0; r < 40; ++r) {
    scene.rays.origins(r, 2) = r % 2 == 0 ? 0.0F : 20.0F;
    scene.rays.directions(r, 2) = r % 2 == 0 ? 1.0F : -1.0F;
    scene.rays.directions(r, 0) = 0.001F * static_cast<float>(r);
  }
  Options options;
  options.alpha_min = 1e-4F;
  options.transmittance_min = 1e-9F;
  const Traced expected = trace(scene, options);
  EXPECT_EQ(expected.hits, count * 40);
  for (const bool in_order : {false, true}) {
    const InOrder order(in_order);
    // 2,000 roundings of the transmittance.
    expect_same(trace_on_device(scene, options), expected, 5e-4, 2e-3);
  }
}

// In one plane, but not in one place: the tree's order is not that of the index.
TEST_F(TraceOnDevice, HitsAtOneDistanceBlendInOrderOfIndex) {
  constexpr int64_t count = 200;
  TestScene scene = blank_scene(count, 0, 40);
  Random random(11);
  for (int64_t i = 0; i < count; ++i) {
    set_facing(scene.surfels, i, 1, 1, 0.02F);
    for (int k = 0; k < 2; ++k) scene.surfels.position(i, k) = static_cast<float>(random.uniform(-0.5, 0.5));
    for (int c = 0; c < 3; ++c) scene.surfels.sh.row(i)[c] = static_cast<float>(5 * random.normal());
  }
  for (int64_t r = 0; r < 40; ++r) {
    for (int k = 0; k < 2; ++k) scene.rays.origins(r, k) = static_cast<float>(random.uniform(-0.5, 0.5));
    scene.rays.directions(r, 2) = 1;
  }
  const Traced expected = trace(scene, smooth_options());
  EXPECT_EQ(expected.hits, count * 40);
  expect_same(trace_on_device(scene, smooth_options()), expected);
}

// What does not fit is traced again in parts, in either kind of sum.
TEST_F(TraceOnDevice, AgreesWithTheCpuWithoutRoomForItsHits) {
  const TestScene scene = smooth_scene(4, 2, 80, 60);
  const Traced expected = trace(scene, smooth_options());
  for (const bool in_order : {false, true}) {
    const InOrder order(in_order);
    for (const int64_t bytes : {0, 20000}) {
      SCOPED_TRACE(bytes);
      expect_same(trace_on_device(scene, smooth_options(), bytes), expected);
    }
  }
}

bool same_bytes(const Traced& a, const Traced& b) {
  return same_bytes(a.output, b.output) && same_bytes(a.gradient, b.gradient);
}

TEST_F(TraceOnDevice, SameBytesEveryRun) {
  const TestScene scene = smooth_scene(5, 3, 150, 100);
  const InOrder order(true);
  for (const int64_t bytes : {int64_t{1} << 30, int64_t{100000}}) {
    const Traced one = trace_on_device(scene, smooth_options(), bytes);
    for (int run = 0; run < 2; ++run) {
      EXPECT_TRUE(same_bytes(one, trace_on_device(scene, smooth_options(), bytes))) << bytes;
    }
  }
}

// The same objects take set after set, and from the second time on memory is there.
TEST_F(TraceOnDevice, KeepsItsMemory) {
  const BvhPtr bvh = make_bvh();
  const SavedPtr saved = make_saved();
  const Options options = smooth_options();
  const TestScene large = smooth_scene(6, 1, 150, 150), small = smooth_scene(7, 1, 60, 50);
  size_t free_bytes = 0;
  Output output;
  InputGradient gradient;
  const PosedSurfels surfels[] = {large.surfels.on(Device::cuda), small.surfels.on(Device::cuda)};
  const Rays rays[] = {large.rays.on(Device::cuda), small.rays.on(Device::cuda)};
  const OutputGradient grads[] = {on(to_float(random_output_gradient(5, 150)), Device::cuda),
                                  on(to_float(random_output_gradient(5, 50)), Device::cuda)};
  const InOrder order(true);
  for (size_t i = 0; i < 6; ++i) {
    const size_t k = i % 2;
    build(surfels[k], options, *bvh);
    forward(surfels[k], *bvh, rays[k], options, output, saved.get());
    backward(surfels[k], rays[k], options, *saved, grads[k], gradient);
    if (i == 2) free_bytes = memory::device_bytes();
    if (i > 2) {
      EXPECT_EQ(memory::device_bytes(), free_bytes);
    }
    expect_same({on(output, Device::cpu), on(gradient, Device::cpu), blended_hits(*saved)},
                trace(k == 0 ? large : small, options));
  }
}

TEST_F(TraceOnDevice, GradientsOfSomeOutputsOnly) {
  const TestScene scene = smooth_scene(8, 1, 50, 60);
  const Options options = smooth_options();
  OutputGradient grad = to_float(random_output_gradient(5, 60));
  grad.colour = {};
  grad.distance = {};
  const BvhPtr bvh = make_bvh();
  const SavedPtr saved = make_saved();
  Traced found, expected;
  for (const Device device : {Device::cpu, Device::cuda}) {
    const PosedSurfels surfels = scene.surfels.on(device);
    const Rays rays = scene.rays.on(device);
    Traced& to = device == Device::cpu ? expected : found;
    build(surfels, options, *bvh);
    forward(surfels, *bvh, rays, options, to.output, saved.get());
    Output alone;
    forward(surfels, *bvh, rays, options, alone, nullptr);
    EXPECT_TRUE(same_bytes(on(alone, Device::cpu), on(to.output, Device::cpu)));
    backward(surfels, rays, options, *saved, on(grad, device), to.gradient);
    to = {on(to.output, Device::cpu), on(to.gradient, Device::cpu), blended_hits(*saved)};
  }
  expect_same(found, expected);
}

}  // namespace
}  // namespace traceflow::trace
