#include "../field_run.h"
#include "ops/field/cuda/column_sums.h"
#include "ops/field/cuda/network.h"
#include "support/device.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;
using field::Precision;

using Pass = FieldPass;
using Case = FieldCase;

class FieldOnDevice : public OnDevice {
 protected:
  void TearDown() override {
    if (!IsSkipped()) cuda::allow_epilogues(true);
    field::device::segment_values = kept_segment_values_;
  }

 private:
  const int64_t kept_segment_values_ = field::device::segment_values;
};

class FieldCasesOnDevice : public FieldOnDevice, public ::testing::WithParamInterface<Case> {};

// Sums of some hundred products in another order differ by some roundings of their largest. Whose ReLU may
// then see the other side of its kink is left out.
TEST_P(FieldCasesOnDevice, Fp32AgreesWithTheCpu) {
  const Case& c = GetParam();
  const Field field = random_field(c.shape, c.outputs);
  const Tensor<float> points = random_points(c.points);
  Tensor<float> grad_output = random_gradient(c.points, c.outputs);
  keep_away_from_kinks(field, points, test_time, grad_output);
  const Pass expected = run_field(Device::cpu, field, points, grad_output, Precision::fp32);
  const Pass found = run_field(Device::cuda, field, points, grad_output, Precision::fp32);
  expect_close(found.output, expected.output, 5e-6, "output");
  expect_fields_close(found.gradient, expected.gradient, 5e-6, 5e-6);
}

// The tolerances of the CPU's bf16 (field_test.cpp), and for the same reasons, against the CPU's fp32.
TEST_P(FieldCasesOnDevice, Bf16AgreesWithinItsPrecision) {
  const Case& c = GetParam();
  const Field field = random_field(c.shape, c.outputs);
  const Tensor<float> points = random_points(c.points);
  const Tensor<float> grad_output = random_gradient(c.points, c.outputs);
  const Pass expected = run_field(Device::cpu, field, points, grad_output, Precision::fp32);
  const Pass found = run_field(Device::cuda, field, points, grad_output, Precision::bf16);
  expect_close(found.output, expected.output, 0.01, "output");
  expect_fields_close(found.gradient, expected.gradient, 0.15, 0.03);
}

// Main and environment outputs and those of a moving map; with a skip and without; a count that is a multiple
// of everything, one that is of nothing, a single point; some that are dealt to several slots, one to all.
INSTANTIATE_TEST_SUITE_P(
    Shapes, FieldCasesOnDevice,
    ::testing::Values(
        Case{{.depth = 8, .width = 256, .skip = 5}, 11, 70},
        Case{{.depth = 4, .width = 96, .skip = 2}, 10, 200},
        Case{{.depth = 4, .width = 64, .skip = 3}, 11, 1300},
        Case{{.depth = 3, .width = 64, .skip = 0}, 3, 256},
        Case{{.depth = 3, .width = 48, .skip = 1, .time_frequencies = 10}, 3, 130},
        Case{{.depth = 1, .width = 16, .skip = 0}, 1, 65},
        Case{{.depth = 2, .width = 16, .skip = 1, .position_frequencies = 0, .time_frequencies = 0}, 17, 64},
        Case{{.depth = 2, .width = 16, .skip = 1, .position_frequencies = 1}, 3, 16500},
        Case{{.depth = 3, .width = 528, .skip = 1}, 11, 70},
        Case{{.depth = 2, .width = 32, .skip = 1, .position_frequencies = 16}, 11, 1}));

// The outputs are the values of one layer, which the encoding and the bias make alone: rounded once, to
// within 2⁻⁸ of each. Were the encoding or its weights rounded too, values that are the small difference of
// large products would be off by 2⁻⁸ of those.
TEST_F(FieldOnDevice, Bf16KeepsTheEncodingsPartNearlyFp32) {
  Field field = random_field({.depth = 1, .width = 64, .skip = 0}, 11);
  field.head_weight.zero();
  for (int64_t k = 0; k < 11; ++k) field.head_weight(k, k) = 1;
  field.head_bias.zero();
  Tensor<float> points = random_points(300);
  for (float& v : points.values()) v *= 40;
  Tensor<float> expected, found;
  field::forward(field, points, test_time, Precision::fp32, expected, nullptr);
  field::forward(field.on(Device::cuda), points.on(Device::cuda), test_time, Precision::bf16, found, nullptr);
  found = found.on(Device::cpu);
  const float largest = *std::max_element(expected.values().begin(), expected.values().end());
  EXPECT_GT(largest, 5);
  for (int64_t i = 0; i < found.size(); ++i) {
    ASSERT_NEAR(found[i], expected[i], std::ldexp(expected[i], -8) + std::ldexp(largest, -15)) << i;
  }
}

// Widths at both ends and one that leaves threads without work; rows that the slots do not divide.
TEST_F(FieldOnDevice, ColumnsAreSummedInSlots) {
  Random random(5);
  for (const int columns : {16, 48, 1024}) {
    const Tensor<float> values = random_tensor<float>({301, columns}, random, -1, 1);
    Tensor<Bf16> rounded(values.shape());
    Tensor<double> expected({4, columns}), expected_rounded({4, columns});
    for (int64_t i = 0; i < 301; ++i) {
      const int64_t slot = ((i + 1) * 4 - 1) / 301;
      for (int64_t k = 0; k < columns; ++k) {
        store(values(i, k), rounded(i, k));
        expected(slot, k) += values(i, k);
        expected_rounded(slot, k) += to_float(rounded(i, k));
      }
    }
    Tensor<float> sums({4, columns}, Device::cuda), rounded_sums({4, columns}, Device::cuda);
    field::cuda::add_column_sums(values.on(Device::cuda).data(), 301, columns, 4, sums.data(), columns);
    field::cuda::add_column_sums(rounded.on(Device::cuda).data(), 301, columns, 4, rounded_sums.data(),
                                 columns);
    expect_close_on_host(sums, expected, 1e-5, "fp32");
    expect_close_on_host(rounded_sums, expected_rounded, 1e-5, "bf16");
  }
}

TEST_F(FieldOnDevice, IsTheSameBytesTwice) {
  const Field field = random_field({.depth = 4, .width = 64, .skip = 2}, 11);
  const Tensor<float> points = random_points(1500);
  const Tensor<float> grad_output = random_gradient(1500, 11);
  for (const Precision precision : both_precisions) {
    const Pass once = run_field(Device::cuda, field, points, grad_output, precision);
    const Pass twice = run_field(Device::cuda, field, points, grad_output, precision);
    EXPECT_TRUE(same_bytes(once.output, twice.output));
    EXPECT_TRUE(same_bytes(once.gradient, twice.gradient));
  }
}

// Segments of 128 points, the last one short; kept all, some and none.
TEST_F(FieldOnDevice, SegmentsAreKeptOrComputedAgainToTheSameBytes) {
  const Field field = random_field({.depth = 4, .width = 64, .skip = 2}, 11);
  const Tensor<float> points = random_points(450);
  Tensor<float> grad_output = random_gradient(450, 11);
  keep_away_from_kinks(field, points, test_time, grad_output);
  for (const Precision precision : both_precisions) {
    field::device::segment_values = int64_t{128} * 64;
    const Pass kept = run_field(Device::cuda, field, points, grad_output, precision);
    for (const int64_t limit : {int64_t{0}, int64_t{400} << 10}) {
      const Pass again = run_field(Device::cuda, field, points, grad_output, precision, limit);
      EXPECT_TRUE(same_bytes(kept.output, again.output));
      EXPECT_TRUE(same_bytes(kept.gradient, again.gradient)) << limit;
    }
    field::device::segment_values = int64_t{1} << 23;
    const Pass whole = run_field(Device::cuda, field, points, grad_output, precision);
    expect_close(kept.output, whole.output, 5e-6, "output");
    expect_fields_close(kept.gradient, whole.gradient, 5e-6, 5e-6);
  }
}

// Two segments, then four of which three fit: what is kept stays within the limit as it grows.
TEST_F(FieldOnDevice, KeptActivationsStayWithinTheirLimit) {
  const Field field = random_field({.depth = 4, .width = 64, .skip = 2}, 11).on(Device::cuda);
  field::device::segment_values = int64_t{128} * 64;
  Tensor<float> output;
  field::Saved saved;
  for (const int64_t count : {250, 450}) {
    const field::device::DeviceLayout layout(field, Precision::fp32, count);
    saved.memory_limit = 3 * field::device::Activations(layout, true).bytes + 1000;
    field::forward(field, random_points(count).on(Device::cuda), test_time, Precision::fp32, output, &saved);
    EXPECT_EQ(saved.kept_blocks, std::min<int64_t>(layout.segments(), 3));
  }
  const size_t before = memory::device_bytes();
  saved.activations = {};
  EXPECT_LE(before - memory::device_bytes(), static_cast<size_t>(saved.memory_limit));
}

// Without fused epilogues the same steps follow as kernels; bf16 is then rounded once more.
TEST_F(FieldOnDevice, AgreesWithoutFusedEpilogues) {
  const Field field = random_field({.depth = 4, .width = 96, .skip = 2}, 10);
  const Tensor<float> points = random_points(200);
  Tensor<float> grad_output = random_gradient(200, 10);
  keep_away_from_kinks(field, points, test_time, grad_output);
  const Pass expected = run_field(Device::cpu, field, points, grad_output, Precision::fp32);
  cuda::allow_epilogues(false);
  const Pass fp32 = run_field(Device::cuda, field, points, grad_output, Precision::fp32);
  expect_close(fp32.output, expected.output, 5e-6, "output");
  expect_fields_close(fp32.gradient, expected.gradient, 5e-6, 5e-6);
  const Pass bf16 = run_field(Device::cuda, field, points, grad_output, Precision::bf16);
  expect_close(bf16.output, expected.output, 0.015, "output");
  expect_fields_close(bf16.gradient, expected.gradient, 0.2, 0.03);
}

TEST_F(FieldOnDevice, ANewFieldIsZeroEverywhereAndNothingIsSaved) {
  Random random(1);
  const Field field = make_field({.depth = 4, .width = 64, .skip = 2}, 11, random).on(Device::cuda);
  Tensor<float> output;
  field::forward(field, random_points(100).on(Device::cuda), 0.5F, Precision::bf16, output, nullptr);
  const Tensor<float> found = output.on(Device::cpu);
  for (const float v : found.values()) EXPECT_EQ(v, 0);
}

TEST_F(FieldOnDevice, WithoutSavingTheOutputIsTheSame) {
  const Field field = random_field({.depth = 5, .width = 64, .skip = 3}, 11);
  const Tensor<float> points = random_points(300);
  Tensor<float> unsaved;
  field::forward(field.on(Device::cuda), points.on(Device::cuda), test_time, Precision::fp32, unsaved,
                 nullptr);
  const Pass saved = run_field(Device::cuda, field, points, random_gradient(300, 11), Precision::fp32);
  expect_close_on_host(unsaved, saved.output, 5e-6, "output");
}

TEST_F(FieldOnDevice, BackwardAddsToTheGradientAndMemoryIsReused) {
  const Field field = random_field({.depth = 3, .width = 32, .skip = 1}, 4).on(Device::cuda);
  field::Saved saved;
  for (const int64_t count : {300, 40, 500}) {
    const Tensor<float> points = random_points(count).on(Device::cuda);
    const Tensor<float> grad_output = random_gradient(count, 4).on(Device::cuda);
    Tensor<float> output;
    field::forward(field, points, test_time, Precision::fp32, output, &saved);
    Field once = zeros_like<float>(field), twice = zeros_like<float>(field);
    field::backward(field, points, test_time, saved, grad_output, once);
    field::backward(field, points, test_time, saved, grad_output, twice);
    field::backward(field, points, test_time, saved, grad_output, twice);
    EXPECT_TRUE(same_bytes(doubled(once.on(Device::cpu)), twice.on(Device::cpu))) << count;
  }
}

TEST_F(FieldOnDevice, BadRowsAreZeroAndPoisonNothing) { expect_bad_rows_poison_nothing(Device::cuda, 400); }

TEST_F(FieldOnDevice, PointsAtTheLimitAreFinite) { expect_finite_at_the_limit(Device::cuda); }

TEST_F(FieldOnDevice, NoPointsGiveNoRowsAndNoGradient) { expect_nothing_of_no_points(Device::cuda); }

TEST_F(FieldOnDevice, BrokenParametersAndTimesDoNotCrash) { expect_no_crash_where_broken(Device::cuda); }

TEST_F(FieldOnDevice, AGradientOfAnotherShapeIsRefused) {
  const Field field = random_field({.depth = 2, .width = 32, .skip = 1}, 4);
  EXPECT_THROW(run_field(Device::cuda, field, random_points(10), random_gradient(10, 3), Precision::fp32),
               InternalError);
}

}  // namespace
}  // namespace traceflow
