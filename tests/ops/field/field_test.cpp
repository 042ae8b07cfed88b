#include "ops/field/field.h"

#include <gtest/gtest.h>

#include <thread>

#include "field_run.h"

namespace traceflow {
namespace {

using field::Precision;
using testing::expect_close;
using testing::expect_fields_close;
using testing::random_field;
using testing::random_gradient;
using testing::random_points;
using testing::same_bytes;
using testing::test_time;
using Pass = testing::FieldPass;
using Case = testing::FieldCase;

Pass run(const Field& field, const Tensor<float>& points, const Tensor<float>& grad_output,
         Precision precision, int64_t memory_limit = int64_t{1} << 29) {
  return testing::run_field(Device::cpu, field, points, grad_output, precision, memory_limit);
}

struct ReferencePass {
  Tensor<double> output;
  BasicField<double> gradient;
};

ReferencePass run_reference(const Field& field, const Tensor<float>& points,
                            const Tensor<float>& grad_output) {
  const BasicField<double> truth = convert<double>(field);
  ReferencePass pass{{}, zeros_like<double>(field)};
  const auto exact_points = convert<double>(points);
  const double exact_time = test_time;
  field::forward_reference(truth, exact_points, exact_time, pass.output);
  field::backward_reference(truth, exact_points, exact_time, convert<double>(grad_output), pass.gradient);
  return pass;
}

class FieldCases : public ::testing::TestWithParam<Case> {};

TEST_P(FieldCases, Fp32MatchesTheReference) {
  const Case& c = GetParam();
  const Field field = random_field(c.shape, c.outputs);
  const Tensor<float> points = random_points(c.points);
  Tensor<float> grad_output = random_gradient(c.points, c.outputs);
  testing::keep_away_from_kinks(field, points, test_time, grad_output);
  const Pass found = run(field, points, grad_output, Precision::fp32);
  const ReferencePass expected = run_reference(field, points, grad_output);
  expect_close(found.output, expected.output, 5e-6, "output");
  expect_fields_close(found.gradient, expected.gradient, 5e-6, 5e-6);
}

// bf16 has 8 bits of significand, an error of 2⁻⁹ a rounding: outputs stay within 1% of the largest. Of the
// ReLUs about one in 250 per layer sees the other side of its kink; what that adds to gradients is noise, up
// to 15% of their length in the first of eight layers, across their direction: along it they stay within 3%.
TEST_P(FieldCases, Bf16MatchesTheReferenceWithinItsPrecision) {
  if (!field::bf16_is_fast()) GTEST_SKIP() << "no bf16 dot products on this machine";
  const Case& c = GetParam();
  const Field field = random_field(c.shape, c.outputs);
  const Tensor<float> points = random_points(c.points);
  const Tensor<float> grad_output = random_gradient(c.points, c.outputs);
  const Pass found = run(field, points, grad_output, Precision::bf16);
  const ReferencePass expected = run_reference(field, points, grad_output);
  expect_close(found.output, expected.output, 0.01, "output");
  expect_fields_close(found.gradient, expected.gradient, 0.15, 0.03);
}

// Shapes at and beside the edges: no skip, skip last, one layer, no octaves, one output, blocks that are
// full, not full, and many.
INSTANTIATE_TEST_SUITE_P(
    Shapes, FieldCases,
    ::testing::Values(
        Case{{.depth = 8, .width = 256, .skip = 5}, 11, 300},
        Case{{.depth = 8, .width = 128, .skip = 5}, 10, 200},
        Case{{.depth = 4, .width = 64, .skip = 3}, 11, 2500},
        Case{{.depth = 3, .width = 128, .skip = 0}, 11, 1100},
        Case{{.depth = 3, .width = 48, .skip = 1, .time_frequencies = 10}, 3, 130},
        Case{{.depth = 1, .width = 16, .skip = 0}, 1, 65},
        Case{{.depth = 2, .width = 16, .skip = 1, .position_frequencies = 0, .time_frequencies = 0}, 17, 64},
        Case{{.depth = 2, .width = 32, .skip = 1, .position_frequencies = 16}, 11, 1},
        Case{{.depth = 2, .width = 528, .skip = 1}, 11, 70}));

TEST(Field, ANewFieldIsZeroEverywhere) {
  Random random(1);
  const Field field = make_field({.depth = 4, .width = 64, .skip = 2}, 11, random);
  Tensor<float> output;
  field::forward(field, random_points(100), 0.5F, Precision::fp32, output, nullptr);
  for (const float v : output.values()) EXPECT_EQ(v, 0);
}

TEST(Field, IsTheSameBytesAtAnyThreadCount) {
  for (const Precision precision : testing::both_precisions) {
    const Field field = random_field({.depth = 4, .width = 128, .skip = 2}, 11);
    const Tensor<float> points = random_points(9001);
    const Tensor<float> grad_output = random_gradient(9001, 11);
    testing::expect_same_bytes_at_any_thread_count([&] {
      Pass pass = run(field, points, grad_output, precision);
      std::vector<Tensor<float>> all = testing::tensors_of(pass.gradient);
      all.push_back(pass.output);
      return all;
    });
  }
}

// A width and a count of their own, so that their products are compiled on the other thread, inside and
// outside of loops.
TEST(Field, IsTheSameBytesOnAnotherThread) {
  const Field field = random_field({.depth = 3, .width = 80, .skip = 2}, 11);
  for (const int64_t count : {100, 1700}) {
    const Tensor<float> points = random_points(count);
    const Tensor<float> grad_output = random_gradient(count, 11);
    Pass other;
    std::thread([&] { other = run(field, points, grad_output, Precision::fp32); }).join();
    const Pass here = run(field, points, grad_output, Precision::fp32);
    EXPECT_TRUE(same_bytes(here.output, other.output));
    EXPECT_TRUE(same_bytes(here.gradient, other.gradient));
  }
}

TEST(Field, ComputingActivationsAgainGivesTheSameBytes) {
  for (const Precision precision : testing::both_precisions) {
    const Field field = random_field({.depth = 4, .width = 128, .skip = 2}, 11);
    const Tensor<float> points = random_points(2000);
    const Tensor<float> grad_output = random_gradient(2000, 11);
    const Pass kept = run(field, points, grad_output, precision);
    for (const int64_t limit : {int64_t{0}, int64_t{3} << 20}) {
      const Pass again = run(field, points, grad_output, precision, limit);
      EXPECT_TRUE(same_bytes(kept.output, again.output));
      EXPECT_TRUE(same_bytes(kept.gradient, again.gradient)) << limit;
    }
  }
}

TEST(Field, SavingDoesNotChangeTheOutput) {
  const Field field = random_field({.depth = 4, .width = 64, .skip = 2}, 11);
  const Tensor<float> points = random_points(1500);
  Tensor<float> unsaved;
  field::forward(field, points, test_time, Precision::fp32, unsaved, nullptr);
  EXPECT_TRUE(same_bytes(run(field, points, random_gradient(1500, 11), Precision::fp32).output, unsaved));
}

TEST(Field, MemoryIsReusedForFewerAndForMorePoints) {
  const Field field = random_field({.depth = 3, .width = 64, .skip = 2}, 11);
  field::Saved saved;
  for (const int64_t count : {3000, 40, 5000}) {
    const Tensor<float> points = random_points(count);
    const Tensor<float> grad_output = random_gradient(count, 11);
    Pass reused{{}, zeros_like<float>(field)};
    field::forward(field, points, test_time, Precision::fp32, reused.output, &saved);
    field::backward(field, points, test_time, saved, grad_output, reused.gradient);
    EXPECT_TRUE(same_bytes(reused.gradient, run(field, points, grad_output, Precision::fp32).gradient));
  }
}

TEST(Field, BackwardAddsToTheGradient) {
  const Field field = random_field({.depth = 3, .width = 32, .skip = 1}, 4);
  const Tensor<float> points = random_points(100);
  const Tensor<float> grad_output = random_gradient(100, 4);
  field::Saved saved;
  Tensor<float> output;
  field::forward(field, points, test_time, Precision::fp32, output, &saved);
  Field once = zeros_like<float>(field), twice = zeros_like<float>(field);
  field::backward(field, points, test_time, saved, grad_output, once);
  field::backward(field, points, test_time, saved, grad_output, twice);
  field::backward(field, points, test_time, saved, grad_output, twice);
  EXPECT_TRUE(same_bytes(testing::doubled(once), twice));
}

TEST(FieldHostile, BadRowsAreZeroAndPoisonNothing) {
  testing::expect_bad_rows_poison_nothing(Device::cpu, 1200);
}

TEST(FieldHostile, PointsAtTheLimitAreFinite) { testing::expect_finite_at_the_limit(Device::cpu); }

TEST(FieldHostile, NoPointsGiveNoRowsAndNoGradient) { testing::expect_nothing_of_no_points(Device::cpu); }

TEST(FieldHostile, BrokenParametersAndTimesDoNotCrash) { testing::expect_no_crash_where_broken(Device::cpu); }

TEST(FieldHostile, AGradientOfAnotherShapeIsRefused) {
  const Field field = random_field({.depth = 2, .width = 32, .skip = 1}, 4);
  EXPECT_THROW(run(field, random_points(10), random_gradient(10, 3), Precision::fp32), InternalError);
}

}  // namespace
}  // namespace traceflow
