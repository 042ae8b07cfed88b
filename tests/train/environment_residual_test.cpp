#include <gtest/gtest.h>

#include "ops/loss/loss.h"
#include "small_run.h"

namespace traceflow {
namespace {

// The term after a whole run in which it has this weight.
double term_after(float weight) {
  TrainOptions options = small_run(40);
  options.loss.environment_residual = weight;
  Trainer trainer = make_trainer(options, "environment_residual");
  LossTerms terms;
  while (trainer.iteration() < 40) terms = trainer.step();
  return terms.environment_residual;
}

TEST(EnvironmentResidual, IsSmallWhereItCosts) {
  const double free = term_after(1e-7F), held = term_after(10);
  EXPECT_GT(free, 0);
  EXPECT_LT(held, free / 2);
  EXPECT_EQ(term_after(0), 0) << "not measured";
}

TEST(EnvironmentResidual, CountsWithItsWeight) {
  LossMeans means;
  means.begin(Device::cpu);
  Tensor<float> rows({2, 2}), gradient({2, 2});
  rows(0, 0) = 4;
  loss::row_norm(rows, 0.5, gradient, means.add(LossMeans::environment_residual, 0.5));
  const LossTerms terms = means.read();
  EXPECT_NEAR(terms.environment_residual, 2, 1e-3);
  EXPECT_DOUBLE_EQ(terms.total, 0.5 * terms.environment_residual);
}

}  // namespace
}  // namespace traceflow
