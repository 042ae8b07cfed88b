#include "../deform_run.h"
#include "support/device.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;
using field::Precision;

using Pass = DeformPass;
using DeformOnDevice = OnDevice;

template <class F>
void for_each_pair(const Pass& found, const Pass& expected, F&& f) {
  std::vector<const Tensor<float>*> tensors;
  const auto keep = [&](const auto&, const Tensor<float>& t) { tensors.push_back(&t); };
  for_each_posed(found.posed, keep);
  found.grad_stored.for_each(keep);
  size_t next = 0;
  const auto compare = [&](const std::string& name, const Tensor<float>& t) { f(name, *tensors[next++], t); };
  for_each_posed(expected.posed, compare);
  expected.grad_stored.for_each(compare);
}

// Residuals differ as the field's outputs do, by some roundings of their largest (field_parity_test.cpp);
// exponentials by two. A ReLU that sees the other side of its kink may add its share to the field's gradient.
void expect_agreement(const Surfels& stored, const Field* field, const Tensor<int32_t>& subset,
                      int sh_degree) {
  const Pass expected = run_deform(Device::cpu, stored, field, subset, sh_degree);
  const Pass found = run_deform(Device::cuda, stored, field, subset, sh_degree);
  for_each_pair(found, expected, [](const std::string& name, const auto& a, const auto& b) {
    expect_close(a, b, 5e-6, name.c_str());
  });
  if (field != nullptr) expect_fields_close(found.grad_field, expected.grad_field, 1e-2, 1e-3);
}

TEST_F(DeformOnDevice, AgreesForMainSurfels) {
  const Field field = random_field(small, residual::main_outputs);
  expect_agreement(random_surfels(300, true), &field, {}, 3);
}

TEST_F(DeformOnDevice, AgreesForEnvironmentSurfels) {
  const Field field = random_field(small, residual::environment_outputs);
  expect_agreement(random_surfels(300, false), &field, {}, 1);
}

TEST_F(DeformOnDevice, AgreesForASubset) {
  const Field field = random_field(small, residual::main_outputs);
  expect_agreement(random_surfels(500, true), &field, tensor_of(some_of(500)), 2);
}

TEST_F(DeformOnDevice, AgreesWhereBodiesCarrySome) {
  const Field field = random_field(small, residual::main_outputs);
  const Surfels stored = partly_carried(random_surfels(500, true));
  expect_agreement(stored, &field, {}, 3);
  expect_agreement(stored, &field, tensor_of(some_of(500)), 2);
}

TEST_F(DeformOnDevice, AgreesWithoutAField) {
  expect_agreement(random_surfels(100, true), nullptr, {}, 0);
  expect_agreement(random_surfels(100, false), nullptr, tensor_of(some_of(100)), 3);
}

TEST_F(DeformOnDevice, AgreesInBf16WithinItsPrecision) {
  const Field field = random_field(small, residual::main_outputs);
  const Surfels stored = random_surfels(300, true);
  const Pass expected = run_deform(Device::cpu, stored, &field);
  const Pass found = run_deform(Device::cuda, stored, &field, {}, 3, Precision::bf16);
  for_each_pair(found, expected, [](const std::string& name, const auto& a, const auto& b) {
    expect_close(a, b, 0.02, name.c_str());
  });
  expect_fields_close(found.grad_field, expected.grad_field, 0.15, 0.03);
}

TEST_F(DeformOnDevice, IsTheSameBytesTwice) {
  const Field field = random_field(small, residual::main_outputs);
  const Surfels stored = random_surfels(700, true);
  const Tensor<int32_t> subset = tensor_of(some_of(700));
  for (const Precision precision : {Precision::fp32, Precision::bf16}) {
    const Pass once = run_deform(Device::cuda, stored, &field, subset, 3, precision);
    const Pass twice = run_deform(Device::cuda, stored, &field, subset, 3, precision);
    for_each_pair(once, twice, [](const std::string& name, const auto& a, const auto& b) {
      EXPECT_TRUE(same_bytes(a, b)) << name;
    });
    EXPECT_TRUE(same_bytes(once.grad_field, twice.grad_field));
  }
}

TEST_F(DeformOnDevice, AFrozenFieldGetsNoGradientAndStoredValuesDo) {
  const Field field = random_field(small, residual::main_outputs);
  const Surfels stored = random_surfels(64, true);
  const Pass frozen = run_deform(Device::cuda, stored, &field, {}, 3, Precision::fp32, true);
  EXPECT_TRUE(same_bytes(frozen.grad_field, zeros_like<float>(field)));
  EXPECT_TRUE(same_bytes(frozen.grad_stored.opacity_logit,
                         run_deform(Device::cuda, stored, &field).grad_stored.opacity_logit));
}

TEST_F(DeformOnDevice, DisplacedSurfelsAgree) {
  for (const bool main : {true, false}) {
    const Field field = random_field(small, main ? residual::main_outputs : residual::environment_outputs);
    const Surfels stored = random_surfels(70, main);
    const Surfels expected = deform::displaced(stored, field, test_time, Precision::fp32);
    const Surfels found =
        deform::displaced(stored.on(Device::cuda), field.on(Device::cuda), test_time, Precision::fp32)
            .on(Device::cpu);
    std::vector<const Tensor<float>*> tensors;
    found.for_each([&](const std::string&, const Tensor<float>& t) { tensors.push_back(&t); });
    size_t next = 0;
    expected.for_each([&](const std::string& name, const Tensor<float>& t) {
      expect_close(*tensors[next++], t, 5e-6, name.c_str());
    });
  }
}

// Hidden where the CPU hides them, to the same bytes, and without a gradient.
TEST_F(DeformOnDevice, BrokenSurfelsAreHiddenAndPoisonNothing) {
  Surfels stored = broken_surfels(random_surfels(150, true));
  stored.rotation(110, 0) = stored.rotation(110, 1) = stored.rotation(110, 2) = stored.rotation(110, 3) = 0;
  const Field field = random_field(small, residual::main_outputs);
  const Pass expected = run_deform(Device::cpu, stored, &field);
  const Pass found = run_deform(Device::cuda, stored, &field);
  for_each_pair(found, expected, [](const std::string& name, const auto& a, const auto& b) {
    ASSERT_TRUE(all_finite(a)) << name;
    expect_close(a, b, 5e-6, name.c_str());
    for (int64_t i = 0; i <= 100; i += 10) {
      for (int64_t k = 0; k < a.row_size(); ++k) EXPECT_EQ(a.row(i)[k], b.row(i)[k]) << name << " of " << i;
    }
  });
  for (int64_t i = 0; i < 150; ++i) EXPECT_EQ(found.posed.opacity[i] == 0, is_broken(i)) << i;
  found.grad_field.for_each(
      [](const std::string& name, const Tensor<float>& t) { EXPECT_TRUE(all_finite(t)) << name; });
}

TEST_F(DeformOnDevice, ABrokenFieldHidesEverySurfel) {
  Field field = random_field(small, residual::main_outputs);
  field.head_bias[residual::rotation] = nan;
  const Pass pass = run_deform(Device::cuda, random_surfels(40, true), &field);
  for (const float o : pass.posed.opacity.values()) EXPECT_EQ(o, 0);
  EXPECT_TRUE(same_bytes(pass.grad_field, zeros_like<float>(field)));
}

TEST_F(DeformOnDevice, NoSurfelsAndOneSurfel) {
  const Field field = random_field(small, residual::main_outputs);
  EXPECT_EQ(run_deform(Device::cuda, random_surfels(0, true), &field).posed.count(), 0);
  EXPECT_EQ(run_deform(Device::cuda, Surfels(), nullptr).posed.count(), 0);
  expect_agreement(random_surfels(1, true), nullptr, {}, 3);
}

}  // namespace
}  // namespace traceflow
