#include <gtest/gtest.h>

#include "small_run.h"

namespace traceflow {
namespace {

// The term after a whole run in which it has this weight.
double term_after(float weight) {
  TrainOptions options = small_run(40);
  options.loss.environment_residual = weight;
  Trainer trainer = make_trainer(options, "environment_residual");
  LossValues terms;
  while (trainer.iteration() < 40) terms = trainer.step();
  return terms["environment_residual"];
}

TEST(EnvironmentResidual, IsSmallWhereItCosts) {
  const double free = term_after(1e-7F), held = term_after(10);
  EXPECT_GT(free, 0);
  EXPECT_LT(held, free / 2);
  EXPECT_EQ(term_after(0), 0) << "not measured";
}

TEST(EnvironmentResidual, CountsWithItsWeight) {
  Frame frame;
  frame.colour = Tensor<float>({4, 4, 3});
  ViewImages target;
  target.colour = frame.colour;
  LossOptions options;
  options.environment_residual = 0.5F;
  Tensor<float> rows({2, 2}), rest;
  rows(0, 0) = 4;
  LossInputs inputs{frame, target, options};
  inputs.environment_residuals = &rows;
  FrameGradient gradient;
  LossMeans means;
  evaluate_objective(inputs, {gradient, rest}, means);
  const LossValues terms = means.read();
  EXPECT_EQ(terms["l1"], 0);
  EXPECT_NEAR(terms["environment_residual"], 2, 1e-3);
  EXPECT_NEAR(terms.total, 0.5 * terms["environment_residual"], 1e-6);
  EXPECT_NEAR(gradient.environment_residuals(0, 0), 0.25, 1e-3);
}

}  // namespace
}  // namespace traceflow
