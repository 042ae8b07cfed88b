#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "math/activation.h"
#include "math/spherical_harmonics.h"
#include "ops/deform/deform.h"

namespace traceflow::deform {

namespace {

using ResidualRow = std::array<float, residual::main_outputs>;

// The subset as a list of stored rows: `at(i)` is posed surfel i's.
struct Rows {
  Rows(const Surfels& stored, const Tensor<int32_t>& listed)
      : subset(listed), count(listed.empty() ? stored.count() : listed.size()) {
    require(listed.empty() || (listed[0] >= 0 && listed[listed.size() - 1] < stored.count()),
            "a subset lists stored surfels in ascending order", std::to_string(stored.count()));
  }
  int64_t at(int64_t i) const { return subset.empty() ? i : subset[i]; }

  const Tensor<int32_t>& subset;
  int64_t count;
};

void resize(const Surfels& stored, int64_t count, int sh_degree, PosedSurfels& posed) {
  require(stored.count() == 0 || stored.sh.dim(1) >= sh_coefficients(sh_degree),
          "stored surfels have the degrees in use", stored.sh.shape().to_string());
  posed.position.resize({count, 3});
  posed.scale.resize({count, 2});
  posed.rotation.resize({count, 4});
  posed.opacity.resize({count});
  posed.sh.resize({count, sh_coefficients(sh_degree), 3});
  posed.tint.resize(stored.has_tint() ? Shape{count} : Shape{});
}

void gather_points(const Surfels& stored, const Rows& rows, Tensor<float>& points) {
  points.resize({rows.count, 3});
  parallel_for("deform gather", rows.count,
               [&](int64_t i) { std::copy_n(stored.position.row(rows.at(i)), 3, points.row(i)); });
}

ResidualRow load_residuals(const Tensor<float>& residuals, int64_t i) {
  ResidualRow row{};
  if (!residuals.empty()) {
    std::copy_n(residuals.row(i), std::min<int64_t>(residuals.row_size(), residual::main_outputs),
                row.begin());
  }
  return row;
}

// True while every number seen was finite: any other makes the sum of v·0 a NaN.
class AllFinite {
 public:
  float see(float v) {
    sum_ += v * 0.0F;
    return v;
  }
  bool holds() const { return sum_ == 0.0F; }

 private:
  float sum_ = 0;
};

// Poses one surfel; whether everything in it can be used.
bool pose(const Surfels& stored, int64_t from, const ResidualRow& r, PosedSurfels& posed, int64_t to) {
  AllFinite finite;
  bool extended = true;
  for (int k = 0; k < 3; ++k) {
    posed.position(to, k) = finite.see(stored.position(from, k) + r[residual::position + k]);
  }
  for (int k = 0; k < 4; ++k) {
    posed.rotation(to, k) = finite.see(stored.rotation(from, k) + r[residual::rotation + k]);
  }
  for (int k = 0; k < 2; ++k) {
    const float scale = std::exp(finite.see(stored.log_scale(from, k) + r[residual::log_scale + k]));
    posed.scale(to, k) = finite.see(scale);
    extended = extended && scale > 0;
  }
  posed.opacity[to] = sigmoid(finite.see(stored.opacity_logit[from] + r[residual::opacity]));
  if (stored.has_tint()) posed.tint[to] = sigmoid(finite.see(stored.tint_logit[from] + r[residual::tint]));
  const float* sh = stored.sh.row(from);
  float* posed_sh = posed.sh.row(to);
  for (int64_t k = 0; k < posed.sh.row_size(); ++k) posed_sh[k] = finite.see(sh[k]);
  return finite.holds() && extended;
}

// What stands in the place of a surfel that cannot be used: finite everywhere and invisible.
void hide(PosedSurfels& posed, int64_t i) {
  std::fill_n(posed.position.row(i), 3, 0.0F);
  std::fill_n(posed.scale.row(i), 2, 1.0F);
  std::fill_n(posed.rotation.row(i), 4, 0.0F);
  posed.rotation(i, 0) = 1;
  posed.opacity[i] = 0;
  std::fill_n(posed.sh.row(i), posed.sh.row_size(), 0.0F);
  if (posed.has_tint()) posed.tint[i] = 0;
}

// dL/dresiduals of one surfel, which are also those of the stored values that the residuals add to.
ResidualRow residual_gradient(const PosedSurfels& posed, const PosedSurfels& grad_posed, int64_t i) {
  ResidualRow grad{};
  for (int k = 0; k < 3; ++k) grad[residual::position + k] = grad_posed.position(i, k);
  for (int k = 0; k < 4; ++k) grad[residual::rotation + k] = grad_posed.rotation(i, k);
  for (int k = 0; k < 2; ++k) grad[residual::log_scale + k] = grad_posed.scale(i, k) * posed.scale(i, k);
  grad[residual::opacity] = grad_posed.opacity[i] * sigmoid_derivative(posed.opacity[i]);
  if (posed.has_tint()) grad[residual::tint] = grad_posed.tint[i] * sigmoid_derivative(posed.tint[i]);
  return grad;
}

// Adds a row of residuals, or of their gradient, to the stored values that they belong to.
void add_to_row(const ResidualRow& row, Surfels& stored, int64_t to) {
  for (int k = 0; k < 3; ++k) stored.position(to, k) += row[residual::position + k];
  for (int k = 0; k < 4; ++k) stored.rotation(to, k) += row[residual::rotation + k];
  for (int k = 0; k < 2; ++k) stored.log_scale(to, k) += row[residual::log_scale + k];
  stored.opacity_logit[to] += row[residual::opacity];
  if (stored.has_tint()) stored.tint_logit[to] += row[residual::tint];
}

void add_to_stored(const ResidualRow& grad, const Tensor<float>& grad_sh, int64_t from, Surfels& grad_stored,
                   int64_t to) {
  add_to_row(grad, grad_stored, to);
  float* sh = grad_stored.sh.row(to);
  const float* more = grad_sh.row(from);
  for (int64_t k = 0; k < grad_sh.row_size(); ++k) sh[k] += more[k];
}

}  // namespace

void forward(const Surfels& stored, const Field* field, float time, const Tensor<int32_t>& subset,
             int sh_degree, field::Precision precision, PosedSurfels& posed, Saved* saved) {
  thread_local Saved unsaved;
  Saved& kept = saved == nullptr ? unsaved : *saved;
  const Rows rows(stored, subset);
  resize(stored, rows.count, sh_degree, posed);
  if (field == nullptr) {
    kept.points.resize({0, 3});
    kept.residuals.resize({});
  } else {
    gather_points(stored, rows, kept.points);
    field::forward(*field, kept.points, time, precision, kept.residuals,
                   saved == nullptr ? nullptr : &kept.field);
  }
  parallel_for("deform pose", rows.count, [&](int64_t i) {
    if (!pose(stored, rows.at(i), load_residuals(kept.residuals, i), posed, i)) hide(posed, i);
  });
}

Surfels displaced(const Surfels& stored, const Field& field, float time, field::Precision precision) {
  Tensor<float> residuals;
  field::forward(field, stored.position, time, precision, residuals, nullptr);
  Surfels result = stored;
  parallel_for("deform displace", stored.count(),
               [&](int64_t i) { add_to_row(load_residuals(residuals, i), result, i); });
  return result;
}

void backward(const Surfels& stored, const Field* field, float time, const Tensor<int32_t>& subset,
              const PosedSurfels& posed, const Saved& saved, const PosedSurfels& grad_posed,
              Surfels& grad_stored, Field* grad_field) {
  thread_local Tensor<float> scratch;
  const Rows rows(stored, subset);
  const bool reaches_field = field != nullptr && grad_field != nullptr && !saved.residuals.empty();
  Tensor<float>& grad_residuals = scratch;
  grad_residuals.reset(reaches_field ? saved.residuals.shape() : Shape{});
  const int64_t shared = std::min<int64_t>(grad_residuals.row_size(), residual::main_outputs);
  parallel_for("deform backward", rows.count, [&](int64_t i) {
    if (posed.opacity[i] == 0) return;  // hidden, or so faint that nothing saw it
    const ResidualRow grad = residual_gradient(posed, grad_posed, i);
    add_to_stored(grad, grad_posed.sh, i, grad_stored, rows.at(i));
    if (shared > 0) std::copy_n(grad.begin(), shared, grad_residuals.row(i));
  });
  if (reaches_field) field::backward(*field, saved.points, time, saved.field, grad_residuals, *grad_field);
}

}  // namespace traceflow::deform
