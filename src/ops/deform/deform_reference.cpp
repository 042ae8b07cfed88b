#include <cmath>
#include <vector>

#include "math/activation.h"
#include "math/spherical_harmonics.h"
#include "ops/deform/deform.h"

// Poses in double precision, one surfel after another (method §1.3).
namespace traceflow::deform {

namespace {

// The residuals of one surfel; zero for those that the field lacks.
struct Residuals {
  explicit Residuals(const double* row, int outputs) {
    for (int i = 0; i < outputs && i < residual::main_outputs; ++i) value[i] = row[i];
  }
  double value[residual::main_outputs] = {};
};

// A surfel at time t before activation.
struct Moved {
  double position[3];
  double rotation[4];
  double log_scale[2];
  double opacity_logit;
  double tint_logit = 0, roughness_logit = 0;
};

Moved move(const BasicSurfels<double>& stored, int64_t i, const Residuals& r) {
  Moved m{};
  for (int k = 0; k < 3; ++k) m.position[k] = stored.position(i, k) + r.value[residual::position + k];
  for (int k = 0; k < 4; ++k) m.rotation[k] = stored.rotation(i, k) + r.value[residual::rotation + k];
  for (int k = 0; k < 2; ++k) m.log_scale[k] = stored.log_scale(i, k) + r.value[residual::log_scale + k];
  m.opacity_logit = stored.opacity_logit[i] + r.value[residual::opacity];
  if (stored.has_tint()) m.tint_logit = stored.tint_logit[i] + r.value[residual::tint];
  if (stored.has_roughness()) m.roughness_logit = stored.roughness_logit[i];
  return m;
}

bool usable(const Moved& m, const double* sh, int64_t sh_values) {
  bool finite =
      std::isfinite(m.opacity_logit) && std::isfinite(m.tint_logit) && std::isfinite(m.roughness_logit);
  for (const double v : m.position) finite = finite && std::isfinite(v);
  for (const double v : m.rotation) finite = finite && std::isfinite(v);
  for (const double v : m.log_scale) finite = finite && std::isfinite(std::exp(v)) && std::exp(v) > 0;
  for (int64_t k = 0; k < sh_values; ++k) finite = finite && std::isfinite(sh[k]);
  return finite;
}

Tensor<double> evaluate(const BasicField<double>* field, const Tensor<double>& points, double time) {
  Tensor<double> residuals;
  if (field != nullptr) field::forward_reference(*field, points, time, residuals);
  return residuals;
}

bool field_moves(const BasicSurfels<double>& stored, int64_t i) {
  return stored.body.empty() || stored.body[i] == moved_by_field;
}

Residuals residuals_of(const BasicSurfels<double>& stored, const Tensor<double>& residuals, int64_t i) {
  return residuals.empty() || !field_moves(stored, i)
             ? Residuals(nullptr, 0)
             : Residuals(residuals.row(i), static_cast<int>(residuals.row_size()));
}

}  // namespace

void forward_reference(const BasicSurfels<double>& stored, const BasicField<double>* field,
                       const Tensor<double>& field_points, double time, int sh_degree,
                       BasicPosedSurfels<double>& posed) {
  const int64_t n = stored.count();
  const int64_t coefficients = sh_coefficients(sh_degree);
  posed.position.reset({n, 3});
  posed.scale.reset({n, 2});
  posed.rotation.reset({n, 4});
  posed.opacity.reset({n});
  posed.sh.reset({n, coefficients, 3});
  posed.tint.reset(stored.has_tint() ? Shape{n} : Shape{});
  posed.roughness.reset(stored.has_roughness() ? Shape{n} : Shape{});
  const Tensor<double> residuals = evaluate(field, field_points, time);
  for (int64_t i = 0; i < n; ++i) {
    posed.scale(i, 0) = posed.scale(i, 1) = 1;
    posed.rotation(i, 0) = 1;
    const Moved m = move(stored, i, residuals_of(stored, residuals, i));
    if (!usable(m, stored.sh.row(i), 3 * coefficients)) continue;
    for (int k = 0; k < 3; ++k) posed.position(i, k) = m.position[k];
    for (int k = 0; k < 4; ++k) posed.rotation(i, k) = m.rotation[k];
    for (int k = 0; k < 2; ++k) posed.scale(i, k) = std::exp(m.log_scale[k]);
    posed.opacity[i] = sigmoid(m.opacity_logit);
    if (stored.has_tint()) posed.tint[i] = sigmoid(m.tint_logit);
    if (stored.has_roughness()) posed.roughness[i] = largest_roughness * sigmoid(m.roughness_logit);
    for (int64_t k = 0; k < 3 * coefficients; ++k) posed.sh.row(i)[k] = stored.sh.row(i)[k];
  }
}

void backward_reference(const BasicSurfels<double>& stored, const BasicField<double>* field,
                        const Tensor<double>& field_points, double time,
                        const BasicPosedSurfels<double>& grad_posed, BasicSurfels<double>& grad_stored,
                        BasicField<double>* grad_field) {
  const int64_t n = stored.count();
  const int64_t sh_values = n == 0 ? 0 : grad_posed.sh.row_size();
  const Tensor<double> residuals = evaluate(field, field_points, time);
  Tensor<double> grad_residuals(Shape{n, field == nullptr ? 0 : field->outputs()});
  for (int64_t i = 0; i < n; ++i) {
    const Moved m = move(stored, i, residuals_of(stored, residuals, i));
    if (!usable(m, stored.sh.row(i), sh_values)) continue;
    std::vector<double> grad(residual::main_outputs, 0.0);
    for (int k = 0; k < 3; ++k) grad[residual::position + k] = grad_posed.position(i, k);
    for (int k = 0; k < 4; ++k) grad[residual::rotation + k] = grad_posed.rotation(i, k);
    for (int k = 0; k < 2; ++k)
      grad[residual::log_scale + k] = grad_posed.scale(i, k) * std::exp(m.log_scale[k]);
    grad[residual::opacity] = grad_posed.opacity[i] * sigmoid_derivative(sigmoid(m.opacity_logit));
    if (stored.has_tint())
      grad[residual::tint] = grad_posed.tint[i] * sigmoid_derivative(sigmoid(m.tint_logit));

    for (int k = 0; k < 3; ++k) grad_stored.position(i, k) += grad[residual::position + k];
    for (int k = 0; k < 4; ++k) grad_stored.rotation(i, k) += grad[residual::rotation + k];
    for (int k = 0; k < 2; ++k) grad_stored.log_scale(i, k) += grad[residual::log_scale + k];
    grad_stored.opacity_logit[i] += grad[residual::opacity];
    if (stored.has_tint()) grad_stored.tint_logit[i] += grad[residual::tint];
    if (stored.has_roughness()) {
      grad_stored.roughness_logit[i] +=
          grad_posed.roughness[i] * largest_roughness * sigmoid_derivative(sigmoid(m.roughness_logit));
    }
    for (int64_t k = 0; k < sh_values; ++k) grad_stored.sh.row(i)[k] += grad_posed.sh.row(i)[k];
    for (int64_t k = 0; field_moves(stored, i) && k < grad_residuals.row_size() && k < residual::main_outputs;
         ++k) {
      grad_residuals(i, k) = grad[k];
    }
  }
  if (field != nullptr && grad_field != nullptr) {
    field::backward_reference(*field, field_points, time, grad_residuals, *grad_field);
  }
}

}  // namespace traceflow::deform
