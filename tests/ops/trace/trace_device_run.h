#pragma once

#include "base/device_memory.h"
#include "ops/trace/trace_run.h"
#include "support/device.h"

// Both passes of the tracer on the device, and how what it finds is held against what the CPU finds.
namespace traceflow::trace {

inline Output on(const Output& o, Device device) {
  return {o.colour.on(device), o.alpha.on(device), o.distance.on(device)};
}
inline InputGradient on(const InputGradient& g, Device device) {
  return {g.surfels.on(device), g.rays.on(device), g.position_gradient.on(device)};
}
inline OutputGradient on(const OutputGradient& g, Device device) {
  return {g.colour.on(device), g.alpha.on(device), g.distance.on(device)};
}

// Both passes on the device, seen from the host.
inline Traced trace_on_device(const TestScene& scene, const Options& options,
                              int64_t limit = int64_t{1} << 30) {
  constexpr Device device = Device::cuda;
  const PosedSurfels surfels = scene.surfels.on(device);
  const Rays rays = scene.rays.on(device);
  const BvhPtr bvh = make_bvh();
  const SavedPtr saved = make_saved();
  limit_device_bytes(*saved, limit);
  Output output;
  InputGradient gradient;
  build(surfels, options, *bvh);
  forward(surfels, *bvh, rays, options, output, saved.get());
  backward(surfels, rays, options, *saved, on(to_float(random_output_gradient(5, rays.count())), device),
           gradient);
  return {on(output, Device::cpu), on(gradient, Device::cpu), blended_hits(*saved)};
}

// How many numbers are farther than `tolerance` of the root mean square from what is expected.
inline int64_t count_far(const Tensor<float>& found, const Tensor<float>& expected, double tolerance) {
  EXPECT_EQ(found.shape(), expected.shape());
  double squares = 0;
  for (const float v : expected.values()) squares += static_cast<double>(v) * v;
  const double limit =
      tolerance * std::sqrt(squares / static_cast<double>(std::max<int64_t>(1, found.size())));
  int64_t far = 0;
  for (int64_t i = 0; i < found.size(); ++i) far += !(std::abs(found[i] - expected[i]) <= limit);
  return far;
}

// The two differ in how e^x and the sums of colours are rounded, and on a device in which products are fused;
// that is some 1e-6 of a number, more where gradients of both signs are added up.
inline void expect_same(const Traced& found, const Traced& expected, double value = 2e-5,
                        double slope = 5e-4) {
  // A hit at the cut-off, which weighs next to nothing, may fall to either side.
  EXPECT_NEAR(static_cast<double>(found.hits), static_cast<double>(expected.hits), 2);
  EXPECT_EQ(count_far(found.output.colour, expected.output.colour, value), 0);
  EXPECT_EQ(count_far(found.output.alpha, expected.output.alpha, value), 0);
  EXPECT_EQ(count_far(found.output.distance, expected.output.distance, value), 0);
  const InputGradient &f = found.gradient, &e = expected.gradient;
  EXPECT_EQ(count_far(f.surfels.position, e.surfels.position, slope), 0);
  EXPECT_EQ(count_far(f.surfels.scale, e.surfels.scale, slope), 0);
  EXPECT_EQ(count_far(f.surfels.rotation, e.surfels.rotation, slope), 0);
  EXPECT_EQ(count_far(f.surfels.opacity, e.surfels.opacity, slope), 0);
  EXPECT_EQ(count_far(f.surfels.sh, e.surfels.sh, slope), 0);
  EXPECT_EQ(count_far(f.rays.origins, e.rays.origins, slope), 0);
  EXPECT_EQ(count_far(f.rays.directions, e.rays.directions, slope), 0);
  EXPECT_EQ(count_far(f.rays.widths, e.rays.widths, slope), 0);
  EXPECT_EQ(count_far(f.position_gradient, e.position_gradient, slope), 0);
}

// Sums in a fixed order, for as long as it stands.
class InOrder {
 public:
  explicit InOrder(bool on) { traceflow::cuda::set_deterministic(on); }
  ~InOrder() { traceflow::cuda::set_deterministic(false); }
  InOrder(const InOrder&) = delete;
  InOrder& operator=(const InOrder&) = delete;
};

// Faint surfels and a far cut-off: nothing falls to either side of a threshold.
inline TestScene smooth_scene(uint64_t seed, int degree, int64_t surfels, int64_t rays) {
  return random_scene(seed, {.surfels = surfels, .rays = rays, .sh_degree = degree, .opacity_max = 0.5});
}
inline Options smooth_options() {
  Options options;
  options.alpha_min = 1e-9F;
  options.transmittance_min = 0;
  options.background = {0.4F, 0.1F, 0.2F};
  return options;
}

}  // namespace traceflow::trace
