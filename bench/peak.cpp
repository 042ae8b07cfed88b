#include "peak.h"

#include <algorithm>
#include <cstddef>
#include <ctime>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "peak.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace traceflow::bench::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Twelve independent chains of multiply-adds; returns how many operations that were.
double multiply_add(size_t rounds, float* result) {
  const hn::ScalableTag<float> d;
  const auto factor = hn::Set(d, 0.999F);
  const auto addend = hn::Set(d, *result);
  // Each chain starts elsewhere, or the compiler would compute one for all.
  const auto start = [&](float offset) { return hn::Add(addend, hn::Set(d, offset)); };
  auto a0 = start(0), a1 = start(1), a2 = start(2), a3 = start(3), a4 = start(4), a5 = start(5);
  auto a6 = start(6), a7 = start(7), a8 = start(8), a9 = start(9), a10 = start(10), a11 = start(11);
  for (size_t i = 0; i < rounds; ++i) {
    a0 = hn::MulAdd(a0, factor, addend);
    a1 = hn::MulAdd(a1, factor, addend);
    a2 = hn::MulAdd(a2, factor, addend);
    a3 = hn::MulAdd(a3, factor, addend);
    a4 = hn::MulAdd(a4, factor, addend);
    a5 = hn::MulAdd(a5, factor, addend);
    a6 = hn::MulAdd(a6, factor, addend);
    a7 = hn::MulAdd(a7, factor, addend);
    a8 = hn::MulAdd(a8, factor, addend);
    a9 = hn::MulAdd(a9, factor, addend);
    a10 = hn::MulAdd(a10, factor, addend);
    a11 = hn::MulAdd(a11, factor, addend);
  }
  const auto low = hn::Add(hn::Add(hn::Add(a0, a1), hn::Add(a2, a3)), hn::Add(a4, a5));
  const auto high = hn::Add(hn::Add(hn::Add(a6, a7), hn::Add(a8, a9)), hn::Add(a10, a11));
  *result = hn::GetLane(hn::SumOfLanes(d, hn::Add(low, high)));
  return static_cast<double>(rounds * 12 * 2 * hn::Lanes(d));
}

}  // namespace traceflow::bench::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace traceflow::bench {

HWY_EXPORT(multiply_add);

namespace {

#if defined(__x86_64__)
// Highway has no name for the native instruction.
__attribute__((target("avx512f,avx512bf16"))) double dot_bf16(size_t rounds, float* result) {
  const __m512bh factor = _mm512_cvtne2ps_pbh(_mm512_set1_ps(*result), _mm512_set1_ps(0.5F));
  __m512 sums[12];
  for (int i = 0; i < 12; ++i) sums[i] = _mm512_set1_ps(*result + static_cast<float>(i));
  for (size_t i = 0; i < rounds; ++i) {
    for (__m512& sum : sums) sum = _mm512_dpbf16_ps(sum, factor, factor);
  }
  for (int i = 1; i < 12; ++i) sums[0] = _mm512_add_ps(sums[0], sums[i]);
  *result = _mm512_cvtss_f32(sums[0]);
  return static_cast<double>(rounds * 12 * 2 * 32);
}
#endif

// The best rate of several rounds of a loop that returns its operations.
template <class Loop>
double best_rate(Loop&& loop) {
  volatile float sink = 0.25F;
  double best = 0;
  for (int round = 0; round < 10; ++round) {
    float value = 0.25F;
    const double start = cpu_seconds();
    const double operations = loop(size_t{1} << 20, &value);
    best = std::max(best, operations / (cpu_seconds() - start) * 1e-9);
    sink = value;
  }
  static_cast<void>(sink);
  return best;
}

}  // namespace

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double peak_fp32() {
  return best_rate(
      [](size_t rounds, float* result) { return HWY_DYNAMIC_DISPATCH(multiply_add)(rounds, result); });
}

double peak_bf16() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512bf16")) return best_rate(dot_bf16);
#endif
  return 0;
}

}  // namespace traceflow::bench
#endif
