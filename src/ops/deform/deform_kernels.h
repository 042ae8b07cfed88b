#pragma once

#include <cmath>
#include <cstdint>

#include "math/activation.h"
#include "scene/field.h"
#include "scene/surfels.h"

// The steps of posing, each for one surfel or for one number of its harmonics. The harmonics are nine tenths
// of a surfel and only copied: on the CUDA device they have their own threads, so that neighbouring threads
// read neighbouring numbers.
namespace traceflow::deform {

// Addresses of stored surfels, posed surfels, and their gradients. T may be const.
template <class T>
struct StoredAddresses {
  template <class Surfels>
  explicit StoredAddresses(Surfels& s)
      : position(s.position.data()),
        log_scale(s.log_scale.data()),
        rotation(s.rotation.data()),
        opacity_logit(s.opacity_logit.data()),
        sh(s.sh.data()),
        tint_logit(s.has_tint() ? s.tint_logit.data() : nullptr),
        roughness_logit(s.has_roughness() ? s.roughness_logit.data() : nullptr),
        sh_row(s.sh.row_size()) {}

  T *position, *log_scale, *rotation, *opacity_logit, *sh;
  T *tint_logit, *roughness_logit;  // null for the environment; roughness_logit also if the set has none
  int64_t sh_row;
};
template <class T>
struct PosedAddresses {
  template <class Posed>
  explicit PosedAddresses(Posed& p)
      : position(p.position.data()),
        scale(p.scale.data()),
        rotation(p.rotation.data()),
        opacity(p.opacity.data()),
        sh(p.sh.data()),
        tint(p.has_tint() ? p.tint.data() : nullptr),
        roughness(p.has_roughness() ? p.roughness.data() : nullptr),
        sh_row(p.sh.row_size()) {}

  T *position, *scale, *rotation, *opacity, *sh;
  T *tint, *roughness;  // null for the environment; roughness also if the set has none
  int64_t sh_row;
};

// The subset as a list of stored rows: at(i) is the row of posed surfel i.
struct Rows {
  const int32_t* subset;  // null: all

  TRACEFLOW_HD int64_t at(int64_t i) const { return subset == nullptr ? i : subset[i]; }
};

// A row of the field's output; zero for outputs that the field lacks (method §1.2).
struct ResidualRow {
  float value[residual::main_outputs];

  TRACEFLOW_HD float operator[](int k) const { return value[k]; }
  TRACEFLOW_HD float& operator[](int k) { return value[k]; }
};
// A field's outputs, or their gradient. T may be const.
template <class T>
struct Residuals {
  T* rows;  // null: no field
  int columns;

  TRACEFLOW_HD ResidualRow load(int64_t i) const {
    ResidualRow row;
    for (int k = 0; k < residual::main_outputs; ++k) {
      row[k] = rows != nullptr && k < columns ? rows[i * columns + k] : 0.0F;
    }
    return row;
  }
  TRACEFLOW_HD void add(int64_t i, const ResidualRow& row) const {
    for (int k = 0; k < residual::main_outputs; ++k) {
      if (rows != nullptr && k < columns) rows[i * columns + k] += row[k];
    }
  }
};

// True while every number seen was finite: v·0 is NaN for any other v.
class AllFinite {
 public:
  TRACEFLOW_HD float see(float v) {
    sum_ += v * 0.0F;
    return v;
  }
  TRACEFLOW_HD bool holds() const { return sum_ == 0.0F; }

 private:
  float sum_ = 0;
};

// Whether the field moves posed surfel i.
struct IsMovedByField {
  Rows rows;
  const int32_t* body;

  TRACEFLOW_HD bool operator()(int64_t i) const { return body[rows.at(i)] == moved_by_field; }
};

// Copies the points where the field is evaluated. i: a posed surfel that the field moves.
struct Gather {
  Rows rows, moved;
  const float* position;
  float* points;

  TRACEFLOW_HD void operator()(int64_t i) const {
    for (int k = 0; k < 3; ++k) points[3 * i + k] = position[3 * rows.at(moved.at(i)) + k];
  }
};

// Copies the field's outputs to the rows of the posed surfels that it moves. i: (such a surfel, output).
struct SpreadResiduals {
  Rows moved;
  const float* from;
  float* to;
  int columns;

  TRACEFLOW_HD void operator()(int64_t i) const {
    to[moved.at(i / columns) * columns + i % columns] = from[i];
  }
};
// Copies their gradient back.
struct CollectResiduals {
  Rows moved;
  const float* from;
  float* to;
  int columns;

  TRACEFLOW_HD void operator()(int64_t i) const {
    to[i] = from[moved.at(i / columns) * columns + i % columns];
  }
};

// Copies the harmonics of the degrees in use. i: (posed surfel, number).
struct PoseSh {
  Rows rows;
  StoredAddresses<const float> stored;
  PosedAddresses<float> posed;
  uint8_t* broken;  // per surfel; set if a number is not finite

  TRACEFLOW_HD void operator()(int64_t i) const {
    const auto index = static_cast<uint32_t>(i);
    const auto width = static_cast<uint32_t>(posed.sh_row);
    const int64_t to = index / width;
    AllFinite finite;
    posed.sh[i] = finite.see(stored.sh[rows.at(to) * stored.sh_row + index % width]);
    if (!finite.holds()) broken[to] = 1;
  }
  // Copies all numbers of a surfel and returns whether they are finite.
  bool row(int64_t to) const {
    const float* from = stored.sh + rows.at(to) * stored.sh_row;
    float* copy = posed.sh + to * posed.sh_row;
    AllFinite finite;
    for (int64_t k = 0; k < posed.sh_row; ++k) copy[k] = finite.see(from[k]);
    return finite.holds();
  }
};

// Poses one surfel except its harmonics, or hides it.
struct Pose {
  Rows rows;
  StoredAddresses<const float> stored;
  Residuals<const float> residuals;
  PosedAddresses<float> posed;
  const uint8_t* broken;  // of the harmonics

  TRACEFLOW_HD void operator()(int64_t i) const {
    if (!values(i) || broken[i] != 0) hide(i);
  }
  // Poses the values and returns whether all are finite.
  TRACEFLOW_HD bool values(int64_t i) const {
    const int64_t from = rows.at(i);
    const ResidualRow r = residuals.load(i);
    AllFinite finite;
    bool extended = true;
    for (int k = 0; k < 3; ++k) {
      posed.position[3 * i + k] = finite.see(stored.position[3 * from + k] + r[residual::position + k]);
    }
    for (int k = 0; k < 4; ++k) {
      posed.rotation[4 * i + k] = finite.see(stored.rotation[4 * from + k] + r[residual::rotation + k]);
    }
    for (int k = 0; k < 2; ++k) {
      const float scale = std::exp(finite.see(stored.log_scale[2 * from + k] + r[residual::log_scale + k]));
      posed.scale[2 * i + k] = finite.see(scale);
      extended = extended && scale > 0;
    }
    posed.opacity[i] = sigmoid(finite.see(stored.opacity_logit[from] + r[residual::opacity]));
    if (posed.tint != nullptr) {
      posed.tint[i] = sigmoid(finite.see(stored.tint_logit[from] + r[residual::tint]));
    }
    if (posed.roughness != nullptr)
      posed.roughness[i] = roughness_of(finite.see(stored.roughness_logit[from]));
    return finite.holds() && extended;
  }
  // Replaces a surfel that cannot be used: every value finite, opacity 0.
  TRACEFLOW_HD void hide(int64_t i) const {
    for (int k = 0; k < 3; ++k) posed.position[3 * i + k] = 0;
    for (int k = 0; k < 2; ++k) posed.scale[2 * i + k] = 1;
    for (int k = 0; k < 4; ++k) posed.rotation[4 * i + k] = k == 0 ? 1.0F : 0.0F;
    posed.opacity[i] = 0;
    for (int64_t k = 0; k < posed.sh_row; ++k) posed.sh[i * posed.sh_row + k] = 0;
    if (posed.tint != nullptr) posed.tint[i] = 0;
    if (posed.roughness != nullptr) posed.roughness[i] = 0;
  }
};

// Adds a row of residuals, or of their gradient, to the corresponding stored values.
struct AddToStored {
  StoredAddresses<float> stored;

  TRACEFLOW_HD void operator()(const ResidualRow& row, int64_t to) const {
    for (int k = 0; k < 3; ++k) stored.position[3 * to + k] += row[residual::position + k];
    for (int k = 0; k < 4; ++k) stored.rotation[4 * to + k] += row[residual::rotation + k];
    for (int k = 0; k < 2; ++k) stored.log_scale[2 * to + k] += row[residual::log_scale + k];
    stored.opacity_logit[to] += row[residual::opacity];
    if (stored.tint_logit != nullptr) stored.tint_logit[to] += row[residual::tint];
  }
};

// Adds the residuals to one surfel that the field moves.
struct Displace {
  Residuals<const float> residuals;
  const int32_t* body;  // null: it moves all
  AddToStored add;

  TRACEFLOW_HD void operator()(int64_t i) const {
    if (body == nullptr || body[i] == moved_by_field) add(residuals.load(i), i);
  }
};

// A surfel that is hidden, or too faint to be seen, has no gradient.
TRACEFLOW_HD inline bool unseen(const PosedAddresses<const float>& posed, int64_t i) {
  return posed.opacity[i] == 0;
}

// i: (posed surfel, number).
struct PoseShBackward {
  Rows rows;
  PosedAddresses<const float> posed, grad_posed;
  StoredAddresses<float> grad_stored;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const auto index = static_cast<uint32_t>(i);
    const auto width = static_cast<uint32_t>(grad_posed.sh_row);
    const int64_t from = index / width;
    if (unseen(posed, from)) return;
    grad_stored.sh[rows.at(from) * grad_stored.sh_row + index % width] += grad_posed.sh[i];
  }
  // All numbers of a surfel.
  void row(int64_t from) const {
    float* to = grad_stored.sh + rows.at(from) * grad_stored.sh_row;
    const float* more = grad_posed.sh + from * grad_posed.sh_row;
    for (int64_t k = 0; k < grad_posed.sh_row; ++k) to[k] += more[k];
  }
};

// dL/dresiduals of one surfel, which is also that of the stored values that they add to.
struct PoseBackward {
  Rows rows;
  PosedAddresses<const float> posed, grad_posed;
  AddToStored add_to_grad_stored;
  Residuals<float> grad_residuals;

  TRACEFLOW_HD void operator()(int64_t i) const {
    if (unseen(posed, i)) return;
    ResidualRow grad{};
    for (int k = 0; k < 3; ++k) grad[residual::position + k] = grad_posed.position[3 * i + k];
    for (int k = 0; k < 4; ++k) grad[residual::rotation + k] = grad_posed.rotation[4 * i + k];
    for (int k = 0; k < 2; ++k) {
      grad[residual::log_scale + k] = grad_posed.scale[2 * i + k] * posed.scale[2 * i + k];
    }
    grad[residual::opacity] = grad_posed.opacity[i] * sigmoid_derivative(posed.opacity[i]);
    if (posed.tint != nullptr) {
      grad[residual::tint] = grad_posed.tint[i] * sigmoid_derivative(posed.tint[i]);
    }
    add_to_grad_stored(grad, rows.at(i));
    // Roughness has no residual.
    if (posed.roughness != nullptr) {
      add_to_grad_stored.stored.roughness_logit[rows.at(i)] +=
          grad_posed.roughness[i] * roughness_derivative(posed.roughness[i]);
    }
    grad_residuals.add(i, grad);
  }
};

}  // namespace traceflow::deform
