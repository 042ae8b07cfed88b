#include "ops/deform/deform.h"

#include <gtest/gtest.h>

#include <numeric>

#include "deform_run.h"

namespace traceflow {
namespace {

using field::Precision;
using testing::broken_surfels;
using testing::expect_close;
using testing::is_broken;
using testing::nan;
using testing::partly_carried;
using testing::random_surfels;
using testing::same_bytes;
using testing::small;
using testing::test_time;
using Pass = testing::DeformPass;

Pass run(const Surfels& stored, const Field* field, const Tensor<int32_t>& subset = {}, int sh_degree = 3,
         Precision precision = Precision::fp32, bool frozen = false) {
  return testing::run_deform(Device::cpu, stored, field, subset, sh_degree, precision, frozen);
}

void expect_posed_close(const PosedSurfels& found, const BasicPosedSurfels<double>& expected,
                        double tolerance) {
  std::vector<const Tensor<float>*> tensors;
  testing::for_each_posed(found, [&](const char*, const Tensor<float>& t) { tensors.push_back(&t); });
  size_t next = 0;
  testing::for_each_posed(expected, [&](const char* name, const Tensor<double>& t) {
    expect_close(*tensors[next++], t, tolerance, name);
  });
}

void expect_matches_reference(const Surfels& stored, const Field* field, int sh_degree) {
  const Pass found = run(stored, field, {}, sh_degree);
  const BasicSurfels<double> exact = convert<double>(stored);
  const BasicField<double> exact_field = field == nullptr ? BasicField<double>() : convert<double>(*field);
  const BasicField<double>* exact_pointer = field == nullptr ? nullptr : &exact_field;
  BasicPosedSurfels<double> posed;
  deform::forward_reference(exact, exact_pointer, exact.position, test_time, sh_degree, posed);
  expect_posed_close(found.posed, posed, 1e-5);

  BasicSurfels<double> grad_stored = zeros_like<double>(exact);
  BasicField<double> grad_field = zeros_like<double>(exact_field);
  deform::backward_reference(exact, exact_pointer, exact.position, test_time,
                             convert<double>(found.grad_posed), grad_stored,
                             field == nullptr ? nullptr : &grad_field);
  std::vector<const Tensor<float>*> tensors;
  found.grad_stored.for_each([&](const std::string&, const Tensor<float>& t) { tensors.push_back(&t); });
  size_t next = 0;
  grad_stored.for_each([&](const std::string& name, const Tensor<double>& t) {
    expect_close(*tensors[next++], t, 1e-5, name.c_str());
  });
  // A point whose ReLU rounds to the other side of zero may add its share.
  if (field != nullptr) testing::expect_fields_close(found.grad_field, grad_field, 1e-2, 1e-3);
}

TEST(Deform, MatchesTheReferenceForMainSurfels) {
  const Field field = testing::random_field(small, residual::main_outputs);
  expect_matches_reference(random_surfels(300, true), &field, 3);
}

TEST(Deform, MatchesTheReferenceForEnvironmentSurfels) {
  const Field field = testing::random_field(small, residual::environment_outputs);
  expect_matches_reference(random_surfels(300, false), &field, 1);
}

TEST(Deform, MatchesTheReferenceWhereBodiesCarrySome) {
  const Field field = testing::random_field(small, residual::main_outputs);
  expect_matches_reference(partly_carried(random_surfels(300, true)), &field, 3);
}

TEST(Deform, TheFieldMovesWhatItMayAndNothingElse) {
  const Field field = testing::random_field(small, residual::main_outputs);
  Surfels stored = partly_carried(random_surfels(300, true));
  const std::vector<int32_t> subset = testing::some_of(300);
  const Pass pass = run(stored, &field, tensor_of(subset));
  const Surfels displaced = deform::displaced(stored, field, test_time, Precision::fp32);
  for (size_t i = 0; i < subset.size(); ++i) {
    const auto row = static_cast<int64_t>(i);
    const bool stands = pass.posed.position(row, 0) == stored.position(subset[i], 0) &&
                        pass.posed.rotation(row, 2) == stored.rotation(subset[i], 2);
    EXPECT_EQ(stands, stored.body[subset[i]] != moved_by_field) << subset[i];
    EXPECT_NEAR(pass.posed.position(row, 1), displaced.position(subset[i], 1), 1e-6);
  }
  stored.body.fill(0);
  const Pass still = run(stored, &field);
  EXPECT_TRUE(same_bytes(still.posed.position, stored.position));
  EXPECT_TRUE(same_bytes(still.grad_field, zeros_like<float>(field)));
}

TEST(Deform, MatchesTheReferenceWithoutAField) {
  expect_matches_reference(random_surfels(100, true), nullptr, 0);
}

TEST(Deform, WithoutAFieldPosesTheStoredValues) {
  const Surfels stored = random_surfels(50, true);
  const Pass pass = run(stored, nullptr);
  EXPECT_TRUE(same_bytes(pass.posed.position, stored.position));
  EXPECT_TRUE(same_bytes(pass.posed.rotation, stored.rotation));
  EXPECT_TRUE(same_bytes(pass.posed.sh, stored.sh));
  EXPECT_TRUE(same_bytes(pass.grad_stored.position, pass.grad_posed.position));
}

TEST(Deform, CopiesOnlyTheDegreesInUse) {
  const Surfels stored = random_surfels(20, false);
  const Pass pass = run(stored, nullptr, {}, 1);
  ASSERT_EQ(pass.posed.sh.shape(), (Shape{20, 4, 3}));
  for (int64_t i = 0; i < 20; ++i) {
    for (int k = 0; k < 16; ++k) {
      if (k < 4) {
        EXPECT_EQ(pass.posed.sh(i, k, 1), stored.sh(i, k, 1));
      }
      EXPECT_EQ(pass.grad_stored.sh(i, k, 1), k < 4 ? pass.grad_posed.sh(i, k, 1) : 0);
    }
  }
}

TEST(Deform, ASubsetIsASliceOfTheWhole) {
  const Surfels stored = random_surfels(1500, true);
  const Field field = testing::random_field(small, residual::main_outputs);
  const std::vector<int32_t> subset = testing::some_of(1500);
  const Pass whole = run(stored, &field);
  const Pass part = run(stored, &field, tensor_of(subset));
  const auto count = static_cast<int64_t>(subset.size());
  ASSERT_EQ(part.posed.count(), count);

  std::vector<const Tensor<float>*> tensors;
  testing::for_each_posed(whole.posed, [&](const char*, const Tensor<float>& t) { tensors.push_back(&t); });
  size_t next = 0;
  testing::for_each_posed(part.posed, [&](const char* name, const Tensor<float>& t) {
    const Tensor<float>& all = *tensors[next++];
    for (int64_t i = 0; i < count; ++i) {
      for (int64_t k = 0; k < t.row_size(); ++k) {
        ASSERT_NEAR(t.row(i)[k], all.row(subset[static_cast<size_t>(i)])[k], 1e-5) << name;
      }
    }
  });
}

// What reaches the residuals directly goes on to the field and not to the stored values.
TEST(Deform, GradientsOfResidualsReachTheFieldAlone) {
  const Surfels stored = random_surfels(60, false);
  const Field field = testing::random_field(small, residual::environment_outputs);
  deform::Saved saved;
  PosedSurfels posed, nothing;
  deform::forward(stored, &field, test_time, {}, 3, Precision::fp32, posed, &saved);
  nothing.reset_like(posed);
  Random random(8);
  const Tensor<float> grad_residuals = testing::random_tensor<float>(saved.residuals.shape(), random, -1, 1);
  Surfels grad_stored = zeros_like<float>(stored);
  Field found = zeros_like<float>(field), expected = zeros_like<float>(field);
  deform::backward(stored, &field, test_time, {}, posed, saved, nothing, grad_residuals, grad_stored, &found);
  grad_stored.for_each([&](const std::string& name, const Tensor<float>& t) {
    for (const float g : t.values()) ASSERT_EQ(g, 0) << name;
  });
  field::Saved kept;
  Tensor<float> outputs;
  field::forward(field, stored.position, test_time, Precision::fp32, outputs, &kept);
  field::backward(field, stored.position, test_time, kept, grad_residuals, expected);
  testing::expect_fields_close(found, expected, 1e-6, 1e-6);
  EXPECT_THROW(deform::backward(stored, &field, test_time, {}, posed, saved, nothing, Tensor<float>({60, 2}),
                                grad_stored, &found),
               InternalError);
}

// A gradient by a subset is one by all surfels that is zero outside of it.
TEST(Deform, ASubsetsGradientIsScatteredToItsRows) {
  const Surfels stored = random_surfels(400, true);
  const Field field = testing::random_field(small, residual::main_outputs);
  std::vector<int32_t> subset(100);
  std::iota(subset.begin(), subset.end(), 120);
  const Pass part = run(stored, &field, tensor_of(subset));

  deform::Saved saved;
  PosedSurfels posed, grad_posed;
  deform::forward(stored, &field, test_time, {}, 3, Precision::fp32, posed, &saved);
  grad_posed.reset_like(posed);
  std::vector<const Tensor<float>*> tensors;
  testing::for_each_posed(part.grad_posed,
                          [&](const char*, const Tensor<float>& t) { tensors.push_back(&t); });
  size_t next = 0;
  testing::for_each_posed(grad_posed, [&](const char*, Tensor<float>& t) {
    const Tensor<float>& from = *tensors[next++];
    std::copy(from.data(), from.data() + from.size(), t.row(120));
  });
  Surfels grad_stored = zeros_like<float>(stored);
  Field grad_field = zeros_like<float>(field);
  deform::backward(stored, &field, test_time, {}, posed, saved, grad_posed, {}, grad_stored, &grad_field);
  std::vector<const Tensor<float>*> expected;
  grad_stored.for_each([&](const std::string&, const Tensor<float>& t) { expected.push_back(&t); });
  next = 0;
  part.grad_stored.for_each([&](const std::string& name, const Tensor<float>& t) {
    expect_close(t, *expected[next++], 1e-5, name.c_str());
  });
  testing::expect_fields_close(part.grad_field, grad_field, 1e-5, 1e-5);
}

TEST(Deform, AFrozenFieldGetsNoGradientAndStoredValuesDo) {
  const Surfels stored = random_surfels(64, true);
  const Field field = testing::random_field(small, residual::main_outputs);
  const Pass frozen = run(stored, &field, {}, 3, Precision::fp32, true);
  EXPECT_TRUE(same_bytes(frozen.grad_field, zeros_like<float>(field)));
  EXPECT_TRUE(same_bytes(frozen.grad_stored.opacity_logit, run(stored, &field).grad_stored.opacity_logit));
}

TEST(Deform, IsTheSameWithoutSaving) {
  const Surfels stored = random_surfels(500, true);
  const Field field = testing::random_field(small, residual::main_outputs);
  PosedSurfels posed;
  deform::forward(stored, &field, test_time, {}, 3, Precision::fp32, posed, nullptr);
  EXPECT_TRUE(same_bytes(posed.position, run(stored, &field).posed.position));
}

TEST(Deform, DisplacedSurfelsStandWhereTheFieldMovesThem) {
  for (const bool main : {true, false}) {
    const Field field =
        testing::random_field(small, main ? residual::main_outputs : residual::environment_outputs);
    const Surfels stored = random_surfels(70, main);
    const Surfels displaced = deform::displaced(stored, field, test_time, Precision::fp32);
    const PosedSurfels expected = run(stored, &field).posed;
    const PosedSurfels found = run(displaced, nullptr).posed;
    std::vector<Tensor<float>> tensors;
    testing::for_each_posed(found, [&](const char*, const Tensor<float>& t) { tensors.push_back(t); });
    size_t next = 0;
    testing::for_each_posed(expected, [&](const char* name, const Tensor<float>& t) {
      EXPECT_TRUE(same_bytes(tensors[next++], t)) << name;
    });
  }
}

TEST(Deform, IsTheSameBytesAtAnyThreadCount) {
  const Surfels stored = partly_carried(random_surfels(5003, true));
  const Field field = testing::random_field(small, residual::main_outputs);
  for (const Precision precision : {Precision::fp32, Precision::bf16}) {
    testing::expect_same_bytes_at_any_thread_count([&] {
      const Pass pass = run(stored, &field, {}, 3, precision);
      std::vector<Tensor<float>> all = testing::tensors_of(pass.grad_field);
      testing::for_each_posed(pass.posed, [&](const char*, const Tensor<float>& t) { all.push_back(t); });
      pass.grad_stored.for_each([&](const std::string&, const Tensor<float>& t) { all.push_back(t); });
      return all;
    });
  }
}

TEST(DeformHostile, ABrokenSurfelIsInvisibleFiniteAndPoisonsNothing) {
  const Surfels clean = random_surfels(150, true);
  const Surfels stored = broken_surfels(clean);
  const Field field = testing::random_field(small, residual::main_outputs);
  const Pass whole = run(clean, &field);
  const Pass found = run(stored, &field);
  for (int64_t i = 0; i < 150; ++i) {
    EXPECT_EQ(found.posed.opacity[i], is_broken(i) ? 0 : whole.posed.opacity[i]) << i;
    if (!is_broken(i)) {
      EXPECT_EQ(found.posed.position(i, 2), whole.posed.position(i, 2)) << i;
    }
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(found.grad_stored.position(i, k), is_broken(i) ? 0 : whole.grad_stored.position(i, k)) << i;
    }
  }
  testing::for_each_posed(found.posed, [](const char* name, const Tensor<float>& t) {
    EXPECT_TRUE(testing::all_finite(t)) << name;
  });
  for (const float s : found.posed.scale.values()) EXPECT_GT(s, 0);
  found.grad_stored.for_each(
      [](const std::string& name, const Tensor<float>& t) { EXPECT_TRUE(testing::all_finite(t)) << name; });
  found.grad_field.for_each(
      [](const std::string& name, const Tensor<float>& t) { EXPECT_TRUE(testing::all_finite(t)) << name; });
}

TEST(DeformHostile, TheReferenceHidesTheSameSurfels) {
  const BasicSurfels<double> stored = convert<double>(broken_surfels(random_surfels(150, true)));
  BasicPosedSurfels<double> posed;
  deform::forward_reference(stored, nullptr, stored.position, test_time, 3, posed);
  for (int64_t i = 0; i < 150; ++i) {
    // Double precision still holds e^±200.
    const bool hidden = is_broken(i) && i != 30 && i != 40;
    EXPECT_EQ(posed.opacity[i] == 0, hidden) << i;
  }
}

TEST(DeformHostile, ABrokenFieldHidesEverySurfel) {
  const Surfels stored = random_surfels(40, true);
  Field field = testing::random_field(small, residual::main_outputs);
  field.head_bias[residual::rotation] = nan;
  const Pass pass = run(stored, &field);
  for (const float o : pass.posed.opacity.values()) EXPECT_EQ(o, 0);
  EXPECT_TRUE(same_bytes(pass.grad_field, zeros_like<float>(field)));
}

TEST(DeformHostile, NoSurfelsAndOneSurfel) {
  const Field field = testing::random_field(small, residual::main_outputs);
  EXPECT_EQ(run(random_surfels(0, true), &field).posed.count(), 0);
  EXPECT_EQ(run(Surfels(), nullptr).posed.count(), 0);
  EXPECT_EQ(run(random_surfels(1, true), &field).posed.count(), 1);
}

TEST(DeformHostile, ASubsetBeyondTheSurfelsIsRefused) {
  const Surfels stored = random_surfels(10, true);
  const std::vector<int32_t> subset = {3, 10};
  EXPECT_THROW(run(stored, nullptr, tensor_of(subset)), InternalError);
}

}  // namespace
}  // namespace traceflow
