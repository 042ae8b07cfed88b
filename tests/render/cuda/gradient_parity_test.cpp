#include "render/whole_graph.h"
#include "support/device.h"

namespace traceflow::whole_graph {
namespace {

class EndToEndOnDevice : public traceflow::testing::OnDevice, public ::testing::WithParamInterface<Graph> {
 protected:
  void TearDown() override { cuda::set_deterministic(false); }
};

TEST_P(EndToEndOnDevice, RendererGradientAgreesWithReference) {
  expect_agreement_with_reference(GetParam(), Device::cuda);
}

TEST_P(EndToEndOnDevice, SumsInAFixedOrderHaveTheSameBytesEveryTime) {
  cuda::set_deterministic(true);
  const Case c = make_case(GetParam());
  expect_agreement_with_reference(GetParam(), Device::cuda);
  EXPECT_EQ(renderer_gradient(c, Device::cuda), renderer_gradient(c, Device::cuda));
}

INSTANTIATE_TEST_SUITE_P(Graphs, EndToEndOnDevice,
                         ::testing::Values(Graph::diffuse, Graph::diffuse_deformed, Graph::reflected,
                                           Graph::reflected_map, Graph::reflected_far,
                                           Graph::several_samples));

}  // namespace
}  // namespace traceflow::whole_graph
