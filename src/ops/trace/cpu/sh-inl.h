// SH of one surfel in one direction, read directly from the tensor's rows of (r, g, b). Compiled once per
// target.
#if defined(TRACEFLOW_TRACE_SH_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TRACEFLOW_TRACE_SH_INL_H
#undef TRACEFLOW_TRACE_SH_INL_H
#else
#define TRACEFLOW_TRACE_SH_INL_H
#endif

#include <hwy/highway.h>

#include "ops/trace/trace_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR

// The same without vectors.
using Rgb = Vec3<float>;

template <int degree>
struct ShShape {
  static constexpr size_t coefficients = sh_coefficients(degree);
};

template <int degree>
struct ShBasis {
  const float* value;

  explicit ShBasis(const float* padded) : value(padded) {}
  Rgb colour(const float* row) const {
    Rgb sum(0.5F);
    for (size_t k = 0; k < ShShape<degree>::coefficients; ++k) sum += value[k] * load3<float>(row + 3 * k);
    return sum;
  }
  // Adds gradient ⊗ basis, which is dL/dsh.
  void add_gradient(const Rgb& gradient, float* sums) const {
    for (size_t k = 0; k < ShShape<degree>::coefficients; ++k) {
      for (int c = 0; c < 3; ++c) sums[3 * k + static_cast<size_t>(c)] += gradient[c] * value[k];
    }
  }
};

// Adds such sums to a row of the tensor.
template <int degree>
void sh_add_sums(const float* sums, float* row) {
  for (size_t i = 0; i < 3 * ShShape<degree>::coefficients; ++i) row[i] += sums[i];
}

inline Rgb rgb_black() { return Rgb(0); }
inline Rgb rgb_clamp(const Rgb& colour) { return glm::max(colour, Rgb(0)); }
inline Rgb rgb_add(float weight, const Rgb& colour, const Rgb& sum) { return sum + weight * colour; }
inline Rgb rgb_load(const float* padded) { return load3<float>(padded); }
inline void rgb_store(const Rgb& colour, float* padded) { store3(padded, colour); }
// weight · gradient in the channels that are not clamped.
inline Rgb rgb_gradient(const Rgb& raw, float weight, const Rgb& gradient) {
  Rgb result(0);
  for (int c = 0; c < 3; ++c) result[c] = raw[c] > 0 ? weight * gradient[c] : 0;
  return result;
}

// Σ over hits of dL/dcolour · sh, per coefficient: dL/dbasis of one ray.
template <int degree>
class ShBasisGradient {
 public:
  void add(const float* row, const Rgb& gradient) {
    for (size_t k = 0; k < ShShape<degree>::coefficients; ++k) {
      sum_[k] += glm::dot(gradient, load3<float>(row + 3 * k));
    }
  }
  void finish(float* grad_basis) const { std::copy_n(sum_, 16, grad_basis); }

 private:
  float sum_[16] = {};
};

#else

// A vector contains whole coefficients, three lanes each: lane 3i + c is channel c of coefficient i.
using ShTag = hn::CappedTag<float, 16>;
using ShVec = hn::Vec<ShTag>;
using Rgb = ShVec;  // lanes 0, 1, 2; the others are unspecified
inline constexpr size_t sh_lanes = hn::MaxLanes(ShTag());
inline constexpr size_t sh_per_vector = sh_lanes >= 16 ? 4 : sh_lanes >= 8 ? 2 : 1;

template <int degree>
struct ShShape {
  static constexpr size_t coefficients = sh_coefficients(degree);
  static constexpr size_t vectors = (coefficients + sh_per_vector - 1) / sh_per_vector;
  static constexpr size_t lanes(size_t vector) {
    const size_t left = coefficients - vector * sh_per_vector;
    return 3 * (left < sh_per_vector ? left : sh_per_vector);
  }
};

// Loads vector j of a surfel's coefficients, with zeros in unused lanes. Does not read past the row.
template <int degree>
HWY_INLINE ShVec sh_load(const float* HWY_RESTRICT row, size_t j) {
  const ShTag d;
  const float* from = row + 3 * sh_per_vector * j;
  if constexpr (sh_lanes <= 4) {
    HWY_ALIGN const float padded[4] = {from[0], from[1], from[2], 0};
    return hn::Load(d, padded);
  } else {
    return hn::MaskedLoad(hn::FirstN(d, ShShape<degree>::lanes(j)), d, from);
  }
}

// Moves lane i + shift of v to lane i. Lanes whose source is out of range are unspecified.
HWY_INLINE ShVec sh_shift_down(ShVec v, int shift) {
  const ShTag d;
  const hn::RebindToSigned<ShTag> di;
  const auto wrapped =
      hn::And(hn::Add(hn::Iota(di, 0), hn::Set(di, shift)), hn::Set(di, static_cast<int>(sh_lanes) - 1));
  return hn::TableLookupLanes(v, hn::IndicesFromVec(d, wrapped));
}

// The sum over the coefficients of a vector for each channel, in lanes 0, 1, 2.
HWY_INLINE ShVec sh_fold(ShVec v) {
  if constexpr (sh_per_vector >= 4) v = hn::Add(v, sh_shift_down(v, 6));
  if constexpr (sh_per_vector >= 2) v = hn::Add(v, sh_shift_down(v, 3));
  return v;
}

// Loads one value per coefficient from `padded` and copies it to the three lanes of its coefficient.
HWY_INLINE ShVec sh_spread(const float* HWY_RESTRICT padded) {
  HWY_ALIGN static constexpr int32_t lane_of[16] = {0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 0, 0, 0, 0};
  const ShTag d;
  return hn::TableLookupLanes(hn::LoadU(d, padded), hn::SetTableIndices(d, lane_of));
}

// r, g, b, r, g, b, … from lanes 0, 1, 2.
HWY_INLINE ShVec sh_repeat(ShVec rgb) {
  HWY_ALIGN static constexpr int32_t channel_of[16] = {0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 0, 0, 0};
  const ShTag d;
  return hn::TableLookupLanes(rgb, hn::SetTableIndices(d, channel_of));
}

// A ray's basis in the layout of the vectors of a surfel's coefficients.
template <int degree>
struct ShBasis {
  ShVec value[ShShape<degree>::vectors];

  explicit HWY_INLINE ShBasis(const float* HWY_RESTRICT padded) {
    for (size_t j = 0; j < ShShape<degree>::vectors; ++j) value[j] = sh_spread(padded + sh_per_vector * j);
  }
  // Σ_k sh[k] basis[k] + 0.5: the colour before the clamp at zero.
  HWY_INLINE Rgb colour(const float* HWY_RESTRICT row) const {
    ShVec sum = hn::Mul(sh_load<degree>(row, 0), value[0]);
    for (size_t j = 1; j < ShShape<degree>::vectors; ++j) {
      sum = hn::MulAdd(sh_load<degree>(row, j), value[j], sum);
    }
    return hn::Add(sh_fold(sum), hn::Set(ShTag(), 0.5F));
  }
  // Adds gradient ⊗ basis, which is dL/dsh, as vectors in the layout of `value`.
  HWY_INLINE void add_gradient(Rgb gradient, float* HWY_RESTRICT sums) const {
    const ShTag d;
    const ShVec repeated = sh_repeat(gradient);
    for (size_t j = 0; j < ShShape<degree>::vectors; ++j) {
      float* to = sums + j * sh_lanes;
      hn::StoreU(hn::MulAdd(repeated, value[j], hn::LoadU(d, to)), d, to);
    }
  }
};

// Adds such sums to a row of the tensor.
template <int degree>
HWY_INLINE void sh_add_sums(const float* HWY_RESTRICT sums, float* HWY_RESTRICT row) {
  for (size_t j = 0; j < ShShape<degree>::vectors; ++j) {
    for (size_t i = 0; i < ShShape<degree>::lanes(j); ++i)
      row[3 * j * sh_per_vector + i] += sums[j * sh_lanes + i];
  }
}

HWY_INLINE Rgb rgb_black() { return hn::Zero(ShTag()); }
HWY_INLINE Rgb rgb_clamp(Rgb colour) { return hn::Max(colour, hn::Zero(ShTag())); }
HWY_INLINE Rgb rgb_add(float weight, Rgb colour, Rgb sum) {
  return hn::MulAdd(hn::Set(ShTag(), weight), colour, sum);
}
HWY_INLINE Rgb rgb_load(const float* HWY_RESTRICT padded) { return hn::LoadU(ShTag(), padded); }
HWY_INLINE void rgb_store(Rgb colour, float* HWY_RESTRICT padded) { hn::StoreU(colour, ShTag(), padded); }
// weight · gradient in the channels that are not clamped.
HWY_INLINE Rgb rgb_gradient(Rgb raw, float weight, Rgb gradient) {
  const ShTag d;
  return hn::IfThenElseZero(hn::Gt(raw, hn::Zero(d)), hn::Mul(hn::Set(d, weight), gradient));
}

// Σ over hits of dL/dcolour · sh, per coefficient: dL/dbasis of one ray.
template <int degree>
class ShBasisGradient {
 public:
  HWY_INLINE ShBasisGradient() {
    for (ShVec& v : sum_) v = hn::Zero(ShTag());
  }
  HWY_INLINE void add(const float* HWY_RESTRICT row, Rgb gradient) {
    const ShVec repeated = sh_repeat(gradient);
    for (size_t j = 0; j < ShShape<degree>::vectors; ++j) {
      sum_[j] = hn::MulAdd(sh_load<degree>(row, j), repeated, sum_[j]);
    }
  }
  HWY_INLINE void finish(float* HWY_RESTRICT grad_basis) const {
    for (size_t j = 0; j < ShShape<degree>::vectors; ++j) {
      HWY_ALIGN float lanes[sh_lanes];
      hn::Store(sum_[j], ShTag(), lanes);
      for (size_t i = 0; 3 * i < ShShape<degree>::lanes(j); ++i) {
        grad_basis[j * sh_per_vector + i] = lanes[3 * i] + lanes[3 * i + 1] + lanes[3 * i + 2];
      }
    }
  }

 private:
  ShVec sum_[ShShape<degree>::vectors];
};

#endif

}  // namespace traceflow::trace::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
