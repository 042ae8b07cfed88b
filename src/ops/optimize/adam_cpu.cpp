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

void step_on_host(const AdamTask& task, const AdamOptions& options, LeftAlone& left_alone) {
  Tensor<float>& parameter = *task.parameter;
  const Tensor<float>& gradient = *task.gradient;
  AdamState& state = *task.state;
  const std::vector<float>& learning_rates = task.learning_rates;
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

void add_to(cuda::AdamTable& table, const AdamTask& task) {
  const std::vector<float>& rates = task.learning_rates;
  table.tensor[static_cast<size_t>(table.tensors++)] = {
      .parameter = task.parameter->data(),
      .gradient = task.gradient->data(),
      .first = task.state->first.data(),
      .second = task.state->second.data(),
      .count = static_cast<int32_t>(task.parameter->size()),
      .columns = static_cast<int32_t>(rates.size()),
      .first_rate = table.rates,
      .inverse_correction1 = inverse_correction(table.options.beta1, task.state->step),
      .inverse_correction2 = inverse_correction(table.options.beta2, task.state->step),
      .first_block = 0};
  std::copy(rates.begin(), rates.end(), table.rate.begin() + table.rates);
  table.rates += static_cast<int32_t>(rates.size());
}

void step_on_device(std::span<const AdamTask> tasks, const AdamOptions& options, LeftAlone* left_alone) {
  cuda::AdamTable table;
  table.options = options;
  table.left_alone = left_alone;
  for (const AdamTask& task : tasks) {
    if (!table.has_room(task.learning_rates.size())) {
      cuda::adam_step(table);
      table.left_alone += table.tensors;
      table.tensors = table.rates = 0;
    }
    add_to(table, task);
  }
  cuda::adam_step(table);
}

void require_fit(const AdamTask& task, Device device) {
  const int64_t size = task.parameter->size();
  require(task.gradient->size() == size && task.state->first.size() == size &&
              task.state->second.size() == size && !task.learning_rates.empty() &&
              task.learning_rates.size() <= most_rates && size <= LeftAlone::largest_index,
          "gradient and moments fit their parameter", task.parameter->shape().to_string());
  require(task.parameter->device() == device, "all parameters of a step are on one device");
}

}  // namespace

void adam_step(std::span<const AdamTask> tasks, const AdamOptions& options, Tensor<LeftAlone>& left_alone) {
  const Device device = tasks.empty() ? Device::cpu : tasks.front().parameter->device();
  for (const AdamTask& task : tasks) require_fit(task, device);
  left_alone.place(device).reset({static_cast<int64_t>(tasks.size())});
  for (const AdamTask& task : tasks) ++task.state->step;
  if (device == Device::cuda) {
    step_on_device(tasks, options, left_alone.data());
    return;
  }
  int64_t k = 0;
  for (const AdamTask& task : tasks) step_on_host(task, options, left_alone[k++]);
}

int64_t adam_step(Tensor<float>& parameter, const Tensor<float>& gradient, AdamState& state,
                  std::span<const float> learning_rates, const AdamOptions& options) {
  const AdamTask task{&parameter, &gradient, &state, {learning_rates.begin(), learning_rates.end()}};
  Tensor<LeftAlone> left_alone;
  adam_step({&task, 1}, options, left_alone);
  return left_alone.on(Device::cpu)[0].count;
}

}  // namespace traceflow::optimize
#endif  // HWY_ONCE
