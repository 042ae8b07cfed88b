#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "ops/trace/trace_run.h"

namespace traceflow::trace {
namespace {

// Makes the library take one instruction set, until the end of the scope.
class OnlyTarget {
 public:
  explicit OnlyTarget(int64_t target) { hwy::GetChosenTarget().Update(target); }
  ~OnlyTarget() { hwy::GetChosenTarget().Update(hwy::SupportedTargets()); }
  OnlyTarget(const OnlyTarget&) = delete;
  OnlyTarget& operator=(const OnlyTarget&) = delete;
};

void expect_matches_reference(const TestScene& scene) {
  Options options;
  options.alpha_min = 1e-6F;
  const Traced fast = trace(scene, options);
  const auto surfels = convert<double>(scene.surfels);
  const auto rays = convert<double>(scene.rays);
  BasicOutput<double> output;
  BasicInputGradient<double> gradient;
  forward_reference(surfels, rays, options, output);
  backward_reference(surfels, rays, options, random_output_gradient(5, rays.count()), gradient);
  for (int64_t i = 0; i < output.colour.size(); ++i)
    ASSERT_NEAR(fast.output.colour[i], output.colour[i], 1e-4);
  for (int64_t i = 0; i < output.distance.size(); ++i) {
    ASSERT_NEAR(fast.output.distance[i], output.distance[i], 1e-4);
  }
  for (int64_t i = 0; i < gradient.surfels.sh.size(); ++i) {
    ASSERT_NEAR(fast.gradient.surfels.sh[i], gradient.surfels.sh[i], 1e-4);
  }
  for (int64_t i = 0; i < gradient.rays.origins.size(); ++i) {
    ASSERT_NEAR(fast.gradient.rays.origins[i], gradient.rays.origins[i], 1e-2);
    ASSERT_NEAR(fast.gradient.rays.directions[i], gradient.rays.directions[i], 1e-2);
  }
}

// Of all that the machine has, not only the best.
TEST(TraceTargets, EveryInstructionSetMatchesTheReference) {
  for (int64_t left = hwy::SupportedTargets(); left != 0; left &= left - 1) {
    const int64_t target = left & -left;
    SCOPED_TRACE(hwy::TargetName(target));
    const OnlyTarget only(target);
    for (int degree = 0; degree <= 3; ++degree) {
      const SceneOptions o{.surfels = 100, .rays = 100, .sh_degree = degree, .opacity_max = 0.3};
      expect_matches_reference(random_scene(static_cast<uint64_t>(degree), o));
    }
    expect_matches_reference(
        random_scene(4, {.surfels = 100, .rays = 100, .opacity_max = 0.3, .width_max = 0.1}));
  }
}

}  // namespace
}  // namespace traceflow::trace
