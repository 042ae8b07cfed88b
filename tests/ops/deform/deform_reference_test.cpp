#include <gtest/gtest.h>

#include "../field/field_scene.h"
#include "deform_scene.h"
#include "ops/deform/deform.h"

namespace traceflow {
namespace {

using testing::central_differences;
using testing::expect_close;

constexpr NetworkOptions smallest{
    .depth = 3, .width = 16, .skip = 2, .position_frequencies = 1, .time_frequencies = 1};

TEST(DeformReference, AddsResidualsAndActivates) {
  BasicSurfels<double> stored = convert<double>(testing::random_surfels(2, true));
  BasicField<double> field = convert<double>(testing::random_field(smallest, residual::main_outputs));
  field.head_weight.zero();  // every point gets the head's bias
  for (int k = 0; k < residual::main_outputs; ++k) field.head_bias[k] = 0.1 * (k + 1);
  BasicPosedSurfels<double> posed;
  deform::forward_reference(stored, &field, stored.position, 0.5, 1, posed);
  EXPECT_EQ(posed.sh.shape(), (Shape{2, 4, 3}));
  for (int64_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(posed.position(i, 1), stored.position(i, 1) + 0.2, 1e-12);
    EXPECT_NEAR(posed.rotation(i, 0), stored.rotation(i, 0) + 0.4, 1e-12);
    EXPECT_NEAR(posed.rotation(i, 3), stored.rotation(i, 3) + 0.7, 1e-12);
    EXPECT_NEAR(posed.scale(i, 1), std::exp(stored.log_scale(i, 1) + 0.9), 1e-12);
    EXPECT_NEAR(posed.opacity[i], 1 / (1 + std::exp(-stored.opacity_logit[i] - 1.0)), 1e-12);
    EXPECT_NEAR(posed.tint[i], 1 / (1 + std::exp(-stored.tint_logit[i] - 1.1)), 1e-12);
    EXPECT_EQ(posed.sh(i, 3, 2), stored.sh(i, 3, 2));
  }
}

// The position enters the field detached: the field's points stand still while the stored position moves.
TEST(DeformReference, BackwardMatchesCentralDifferencesInEveryParameter) {
  for (const bool tint : {true, false}) {
    BasicSurfels<double> stored = convert<double>(testing::random_surfels(4, tint));
    if (tint) stored.body = tensor_of(std::vector<int32_t>{-1, 0, -2, -1});
    const Tensor<double> points = stored.position;
    const int outputs = tint ? residual::main_outputs : residual::environment_outputs;
    BasicField<double> field = convert<double>(testing::random_field(smallest, outputs));
    BasicPosedSurfels<double> posed;
    deform::forward_reference(stored, &field, points, 0.3, 2, posed);
    const BasicPosedSurfels<double> weights = testing::random_gradient_like(posed);
    const auto loss = [&] {
      deform::forward_reference(stored, &field, points, 0.3, 2, posed);
      return testing::dot(posed, weights);
    };
    BasicSurfels<double> grad_stored = zeros_like<double>(stored);
    BasicField<double> grad_field = zeros_like<double>(field);
    deform::backward_reference(stored, &field, points, 0.3, weights, grad_stored, &grad_field);

    std::vector<Tensor<double>*> parameters;
    const auto collect = [&](const std::string&, Tensor<double>& t) { parameters.push_back(&t); };
    stored.for_each(collect);
    field.for_each(collect);
    size_t next = 0;
    const auto check = [&](const std::string& name, const Tensor<double>& found) {
      expect_close(found, central_differences(*parameters[next++], loss, 1e-6), 1e-6, name.c_str());
    };
    grad_stored.for_each(check);
    grad_field.for_each(check);
  }
}

}  // namespace
}  // namespace traceflow
