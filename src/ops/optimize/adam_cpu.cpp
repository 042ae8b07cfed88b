#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/optimize/adam_cpu.cpp"
#include <hwy/foreach_target.h>
// Highway wants its own header after foreach_target.
#include <hwy/highway.h>

#include "ops/optimize/adam_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::optimize::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// One pass over [begin, end). `rates` holds a rate for each entry of the block. Returns how many gradients
// are not finite.
int64_t update_block(const AdamBlock& b) {
  const hn::ScalableTag<float> d;
  const auto lanes = static_cast<int64_t>(hn::Lanes(d));
  const auto beta1 = hn::Set(d, b.beta1);
  const auto beta2 = hn::Set(d, b.beta2);
  const auto rest1 = hn::Set(d, 1 - b.beta1);
  const auto rest2 = hn::Set(d, 1 - b.beta2);
  const auto scale1 = hn::Set(d, b.inverse_correction1);
  const auto scale2 = hn::Set(d, b.inverse_correction2);
  const auto epsilon = hn::Set(d, b.epsilon);
  int64_t not_finite = 0;
  for (int64_t i = 0; i < b.count; i += lanes) {
    const auto inside = hn::FirstN(d, static_cast<size_t>(std::min(lanes, b.count - i)));
    const auto g = hn::MaskedLoad(inside, d, b.gradient + i);
    const auto squared = hn::Mul(g, g);
    const auto finite = hn::And(inside, hn::IsFinite(squared));
    const auto m0 = hn::MaskedLoad(inside, d, b.first + i);
    const auto v0 = hn::MaskedLoad(inside, d, b.second + i);
    const auto p0 = hn::MaskedLoad(inside, d, b.parameter + i);
    const auto rate = hn::MaskedLoad(inside, d, b.rates + i);
    const auto m = hn::MulAdd(beta1, m0, hn::Mul(rest1, g));
    const auto v = hn::MulAdd(beta2, v0, hn::Mul(rest2, squared));
    const auto root = hn::Add(hn::Sqrt(hn::Mul(v, scale2)), epsilon);
    const auto p = hn::Sub(p0, hn::Div(hn::Mul(rate, hn::Mul(m, scale1)), root));
    hn::BlendedStore(m, finite, d, b.first + i);
    hn::BlendedStore(v, finite, d, b.second + i);
    hn::BlendedStore(p, finite, d, b.parameter + i);
    not_finite +=
        static_cast<int64_t>(hn::CountTrue(d, inside)) - static_cast<int64_t>(hn::CountTrue(d, finite));
  }
  return not_finite;
}

}  // namespace traceflow::optimize::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "ops/optimize/adam.h"

namespace traceflow::optimize {

HWY_EXPORT(update_block);

namespace {

constexpr int64_t block_size = 1 << 14;

// 1 / (1 − β^step)
float inverse_correction(float beta, int64_t step) {
  return static_cast<float>(1 / (1 - std::pow(static_cast<double>(beta), static_cast<double>(step))));
}

void note(const Tensor<float>& gradient, int64_t count, LeftAlone& left_alone) {
  if (count == 0) return;
  const auto values = gradient.values();
  const auto bad = std::find_if(values.begin(), values.end(), [](float v) { return !std::isfinite(v * v); });
  left_alone = {static_cast<int32_t>(count),
                LeftAlone::largest_index - static_cast<int32_t>(bad - values.begin())};
}

void step_on_host(Tensor<float>& parameter, const Tensor<float>& gradient, AdamState& state,
                  std::span<const float> learning_rates, const AdamOptions& options, LeftAlone& left_alone) {
  // Blocks begin at multiples of the row, so that one block's rates serve them all.
  const auto columns = static_cast<int64_t>(learning_rates.size());
  const int64_t grain = std::max<int64_t>(1, block_size / columns) * columns;
  std::vector<float> rates(static_cast<size_t>(grain));
  for (size_t i = 0; i < rates.size(); ++i) rates[i] = learning_rates[i % learning_rates.size()];

  std::vector<int64_t> not_finite(static_cast<size_t>((parameter.size() + grain - 1) / grain));
  parallel_blocks("optimize: adam", parameter.size(), grain, [&](int64_t begin, int64_t end) {
    AdamBlock block;
    block.parameter = parameter.data() + begin;
    block.gradient = gradient.data() + begin;
    block.first = state.first.data() + begin;
    block.second = state.second.data() + begin;
    block.rates = rates.data();
    block.count = end - begin;
    block.beta1 = options.beta1;
    block.beta2 = options.beta2;
    block.epsilon = options.epsilon;
    block.inverse_correction1 = inverse_correction(options.beta1, state.step);
    block.inverse_correction2 = inverse_correction(options.beta2, state.step);
    not_finite[static_cast<size_t>(begin / grain)] = HWY_DYNAMIC_DISPATCH(update_block)(block);
  });
  int64_t total = 0;
  for (const int64_t n : not_finite) total += n;
  note(gradient, total, left_alone);
}

void step_on_device(Tensor<float>& parameter, const Tensor<float>& gradient, AdamState& state,
                    std::span<const float> learning_rates, const AdamOptions& options,
                    LeftAlone* left_alone) {
  cuda::AdamTensor tensor{parameter.data(),
                          gradient.data(),
                          state.first.data(),
                          state.second.data(),
                          parameter.size(),
                          options.beta1,
                          options.beta2,
                          options.epsilon,
                          inverse_correction(options.beta1, state.step),
                          inverse_correction(options.beta2, state.step),
                          static_cast<int32_t>(learning_rates.size()),
                          {},
                          left_alone};
  std::copy(learning_rates.begin(), learning_rates.end(), tensor.rates.begin());
  cuda::adam_step(tensor);
}

}  // namespace

void adam_step(Tensor<float>& parameter, const Tensor<float>& gradient, AdamState& state,
               std::span<const float> learning_rates, const AdamOptions& options, const LeftAloneSlot& slot) {
  require(gradient.size() == parameter.size() && state.first.size() == parameter.size() &&
              state.second.size() == parameter.size() && !learning_rates.empty() &&
              learning_rates.size() <= most_rates && parameter.size() <= LeftAlone::largest_index,
          "gradient and moments fit their parameter", parameter.shape().to_string());
  require(slot.list.device() == parameter.device() && slot.place >= 0 && slot.place < slot.list.size(),
          "what a step leaves alone is noted where its parameter is", slot.list.shape().to_string());
  ++state.step;
  if (parameter.device() == Device::cuda) {
    step_on_device(parameter, gradient, state, learning_rates, options, slot.list.data() + slot.place);
  } else {
    step_on_host(parameter, gradient, state, learning_rates, options, slot.list[slot.place]);
  }
}

int64_t adam_step(Tensor<float>& parameter, const Tensor<float>& gradient, AdamState& state,
                  std::span<const float> learning_rates, const AdamOptions& options) {
  Tensor<LeftAlone> left_alone({1}, parameter.device());
  adam_step(parameter, gradient, state, learning_rates, options, {left_alone, 0});
  return left_alone.on(Device::cpu)[0].count;
}

}  // namespace traceflow::optimize
#endif  // HWY_ONCE
