#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "render/whole_graph.h"

// The end-to-end gradient test: the references' analytic gradient is held against central differences of the
// loss along a random direction in every parameter group of both sets, both networks, the map and the camera;
// then the renderer's single-precision gradient against the references'.
namespace traceflow::whole_graph {
namespace {

class EndToEnd : public testing::TestWithParam<Graph> {};

TEST_P(EndToEnd, ReferenceGradientAgreesWithCentralDifferences) {
  Case c = make_case(GetParam());
  reference::Gradient gradient;
  reference::loss(c.parameters, c.setting, &gradient);
  Random random(11);
  const double step = 1e-6;
  for_each_group(c.parameters, gradient,
                 [&](const std::string& name, std::span<double> x, std::span<double> g) {
                   std::vector<double> direction(x.size());
                   double expected = 0;
                   double size = 0;
                   for (size_t i = 0; i < x.size(); ++i) {
                     direction[i] = random.normal();
                     expected += direction[i] * g[i];
                     size += std::abs(direction[i] * g[i]);
                   }
                   const std::vector<double> start(x.begin(), x.end());
                   const auto loss_at = [&](double t) {
                     for (size_t i = 0; i < x.size(); ++i) x[i] = start[i] + t * direction[i];
                     return reference::loss(c.parameters, c.setting, nullptr);
                   };
                   const double difference = (loss_at(step) - loss_at(-step)) / (2 * step);
                   loss_at(0);
                   EXPECT_NEAR(difference, expected, 1e-4 * size + 1e-8) << name;
                 });
}

TEST_P(EndToEnd, RendererGradientAgreesWithReference) {
  expect_agreement_with_reference(GetParam(), Device::cpu);
}

INSTANTIATE_TEST_SUITE_P(Graphs, EndToEnd,
                         testing::Values(Graph::diffuse, Graph::diffuse_deformed, Graph::reflected,
                                         Graph::reflected_map, Graph::reflected_far, Graph::several_samples));

}  // namespace
}  // namespace traceflow::whole_graph
