#pragma once

#include <limits>

#include "../field/field_scene.h"
#include "deform_scene.h"
#include "ops/deform/deform.h"

// Both passes of posing surfels on either device, and surfels that are broken.
namespace traceflow::testing {

constexpr NetworkOptions small{.depth = 4, .width = 64, .skip = 2};
constexpr float test_time = 0.62F;
constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

// One forward and backward pass with a random gradient, on the host.
struct DeformPass {
  PosedSurfels posed, grad_posed;
  Surfels grad_stored;
  Field grad_field;
};

// A frozen field gets no gradient.
inline DeformPass run_deform(Device device, const Surfels& stored, const Field* field,
                             const Tensor<int32_t>& subset = {}, int sh_degree = 3,
                             field::Precision precision = field::Precision::fp32, bool frozen = false) {
  const Surfels there = stored.on(device);
  const Field field_there = field == nullptr ? Field() : field->on(device);
  const Field* const evaluated = field == nullptr ? nullptr : &field_there;
  const Tensor<int32_t> subset_there = subset.on(device);
  deform::Saved saved;
  PosedSurfels posed;
  deform::forward(there, evaluated, test_time, subset_there, sh_degree, precision, posed, &saved);
  EXPECT_EQ(posed.device(), device);
  const PosedSurfels grad_posed = random_gradient_like(posed.on(Device::cpu));
  Surfels grad_stored = zeros_like<float>(there);
  Field grad_field = zeros_like<float>(field_there);
  deform::backward(there, evaluated, test_time, subset_there, posed, saved, grad_posed.on(device), {},
                   grad_stored, evaluated == nullptr || frozen ? nullptr : &grad_field);
  return {posed.on(Device::cpu), grad_posed, grad_stored.on(Device::cpu), grad_field.on(Device::cpu)};
}

// The field moves every fourth surfel; one in four stands still, the others belong to one of two bodies.
inline Surfels partly_carried(Surfels surfels) {
  surfels.body.resize({surfels.count()});
  for (int64_t i = 0; i < surfels.count(); ++i) surfels.body[i] = static_cast<int32_t>(i % 4) - 2;
  return surfels;
}

inline std::vector<int32_t> some_of(int32_t count) {
  std::vector<int32_t> subset;
  for (int32_t i = 3; i < count; i += i % 5 + 1) subset.push_back(i);
  return subset;
}

// Each kind of stored value broken in its own way, in surfel 10·k.
inline Surfels broken_surfels(const Surfels& clean) {
  Surfels stored = clean;
  stored.position(0, 1) = nan;
  stored.rotation(10, 3) = infinity;
  stored.log_scale(20, 0) = nan;
  stored.log_scale(30, 1) = 200;   // overflows
  stored.log_scale(40, 0) = -200;  // underflows: a disk without extent
  stored.log_scale(50, 0) = -infinity;
  stored.opacity_logit[60] = infinity;
  stored.opacity_logit[70] = nan;
  stored.sh(80, 15, 2) = nan;
  stored.tint_logit[90] = -infinity;
  stored.position(100, 0) = -infinity;
  return stored;
}

inline bool is_broken(int64_t i) { return i % 10 == 0 && i <= 100; }

}  // namespace traceflow::testing
