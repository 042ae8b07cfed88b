#include "ops/deform/deform.h"

#include <limits>

#include "base/parallel.h"
#include "math/spherical_harmonics.h"
#include "ops/deform/deform_kernels.h"
#include "primitives/list_where.h"

namespace traceflow::deform {

namespace {

int64_t posed_count(const Surfels& stored, const Tensor<int32_t>& subset) {
  // Indices on a device are not checked: the program computed them there.
  require(subset.empty() || subset.device() != Device::cpu ||
              (subset[0] >= 0 && subset[subset.size() - 1] < stored.count()),
          "a subset lists stored surfels in ascending order", std::to_string(stored.count()));
  return subset.empty() ? stored.count() : subset.size();
}

Rows rows_of(const Tensor<int32_t>& subset) { return {subset.empty() ? nullptr : subset.data()}; }

Residuals<const float> rows_of(const Tensor<float>& residuals) {
  return {residuals.empty() ? nullptr : residuals.data(), static_cast<int>(residuals.row_size())};
}

void resize(const Surfels& stored, int64_t count, int sh_degree, PosedSurfels& posed) {
  require(stored.count() == 0 || stored.sh.dim(1) >= sh_coefficients(sh_degree),
          "stored surfels have the degrees in use", stored.sh.shape().to_string());
  const Device device = stored.device();
  posed.position.place(device).resize({count, 3});
  posed.scale.place(device).resize({count, 2});
  posed.rotation.place(device).resize({count, 4});
  posed.opacity.place(device).resize({count});
  posed.sh.place(device).resize({count, sh_coefficients(sh_degree), 3});
  posed.tint.place(device).resize(stored.has_tint() ? Shape{count} : Shape{});
  posed.roughness.place(device).resize(stored.has_roughness() ? Shape{count} : Shape{});
  require(posed.sh.size() <= std::numeric_limits<uint32_t>::max(), "posed numbers are counted in 32 bits",
          posed.sh.shape().to_string());
}

void pose(const Surfels& stored, const Tensor<int32_t>& subset, const Tensor<float>& residuals,
          PosedSurfels& posed) {
  thread_local Tensor<uint8_t> broken;
  const int64_t count = posed.count();
  const bool on_cpu = stored.device() == Device::cpu;
  if (!on_cpu) broken.place(stored.device()).reset({count});
  const StoredAddresses<const float> from(stored);
  const PosedAddresses<float> to(posed);
  const PoseSh sh{rows_of(subset), from, to, on_cpu ? nullptr : broken.data()};
  const Pose values{rows_of(subset), from, rows_of(residuals), to, sh.broken};
  if (on_cpu) {
    parallel_for("deform pose", count, [&](int64_t i) {
      const bool usable = sh.row(i);
      if (!values.values(i) || !usable) values.hide(i);
    });
  } else {
    parallel_for(stored.device(), "deform pose: spherical harmonics", posed.sh.size(), sh);
    parallel_for(stored.device(), "deform pose", count, values);
  }
}

void pose_backward(const Tensor<int32_t>& subset, const PosedSurfels& posed, const PosedSurfels& grad_posed,
                   Surfels& grad_stored, const Residuals<float>& grad_residuals) {
  const PosedAddresses<const float> at(posed), grad_at(grad_posed);
  const StoredAddresses<float> to(grad_stored);
  const PoseShBackward sh{rows_of(subset), at, grad_at, to};
  const PoseBackward values{rows_of(subset), at, grad_at, {to}, grad_residuals};
  if (posed.device() == Device::cpu) {
    parallel_for("deform backward", posed.count(), [&](int64_t i) {
      if (unseen(at, i)) return;
      sh.row(i);
      values(i);
    });
  } else {
    parallel_for(posed.device(), "deform backward: spherical harmonics", posed.sh.size(), sh);
    parallel_for(posed.device(), "deform backward", posed.count(), values);
  }
}

// Computes the residuals of all posed surfels: zeros for those that the field does not move, and an empty
// tensor if it moves none.
void evaluate(const Surfels& stored, const Field* field, float time, const Tensor<int32_t>& subset,
              int64_t count, field::Precision precision, Saved& kept, bool keep_for_backward) {
  const Device device = stored.device();
  const bool chosen = !stored.body.empty();
  kept.moved.place(device).resize({0});
  if (field != nullptr && chosen)
    list_where(device, "deform: surfels that the field moves", count,
               IsMovedByField{rows_of(subset), stored.body.data()}, kept.moved);
  const int64_t moved = chosen ? kept.moved.size() : count;
  if (field == nullptr || (chosen && moved == 0)) {
    kept.points.resize({0, 3});
    kept.residuals.resize({});
    return;
  }
  kept.points.place(device).resize({moved, 3});
  parallel_for(device, "deform gather", moved,
               Gather{rows_of(subset), rows_of(kept.moved), stored.position.data(), kept.points.data()});
  Tensor<float>& outputs = chosen ? kept.of_moved : kept.residuals;
  field::forward(*field, kept.points, time, precision, outputs, keep_for_backward ? &kept.field : nullptr);
  if (!chosen) return;
  const int64_t columns = outputs.row_size();
  kept.residuals.place(device).reset({count, columns});
  parallel_for(
      device, "deform: spread residuals", outputs.size(),
      SpreadResiduals{rows_of(kept.moved), outputs.data(), kept.residuals.data(), static_cast<int>(columns)});
}

}  // namespace

void forward(const Surfels& stored, const Field* field, float time, const Tensor<int32_t>& subset,
             int sh_degree, field::Precision precision, PosedSurfels& posed, Saved* saved) {
  thread_local Saved unsaved;
  Saved& kept = saved == nullptr ? unsaved : *saved;
  resize(stored, posed_count(stored, subset), sh_degree, posed);
  evaluate(stored, field, time, subset, posed.count(), precision, kept, saved != nullptr);
  pose(stored, subset, kept.residuals, posed);
}

Surfels displaced(const Surfels& stored, const Field& field, float time, field::Precision precision) {
  Tensor<float> residuals;
  field::forward(field, stored.position, time, precision, residuals, nullptr);
  Surfels result = stored;
  parallel_for(stored.device(), "deform displace", stored.count(),
               Displace{rows_of(residuals),
                        stored.body.empty() ? nullptr : stored.body.data(),
                        {StoredAddresses<float>(result)}});
  return result;
}

void backward(const Surfels& stored, const Field* field, float time, const Tensor<int32_t>& subset,
              const PosedSurfels& posed, const Saved& saved, const PosedSurfels& grad_posed,
              const Tensor<float>& grad_residuals, Surfels& grad_stored, Field* grad_field) {
  thread_local Tensor<float> scratch, collected;
  require(posed.count() == posed_count(stored, subset), "posed are the surfels of the subset",
          std::to_string(posed.count()));
  const bool reaches_field = field != nullptr && grad_field != nullptr && !saved.residuals.empty();
  Tensor<float>& grad_all = scratch;
  grad_all.place(stored.device()).reset(reaches_field ? saved.residuals.shape() : Shape{});
  if (reaches_field && !grad_residuals.empty()) {
    require(grad_residuals.shape() == grad_all.shape(), "residuals have gradients of their shape",
            grad_residuals.shape().to_string());
    grad_all = grad_residuals;
  }
  pose_backward(subset, posed, grad_posed, grad_stored,
                {reaches_field ? grad_all.data() : nullptr, static_cast<int>(grad_all.row_size())});
  if (!reaches_field) return;
  if (!saved.moved.empty()) {
    const auto columns = static_cast<int>(grad_all.row_size());
    collected.place(stored.device()).resize(saved.of_moved.shape());
    parallel_for(stored.device(), "deform: collect gradients of residuals", collected.size(),
                 CollectResiduals{rows_of(saved.moved), grad_all.data(), collected.data(), columns});
  }
  field::backward(*field, saved.points, time, saved.field, saved.moved.empty() ? grad_all : collected,
                  *grad_field);
}

}  // namespace traceflow::deform
