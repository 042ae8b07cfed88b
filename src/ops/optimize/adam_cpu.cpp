#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/optimize/adam_cpu.cpp"
#include <hwy/foreach_target.h>
// Highway's own header must follow foreach_target.
#include <hwy/highway.h>

#include <algorithm>

#include "ops/optimize/adam_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::optimize::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

struct Constants {
  hn::ScalableTag<float> d;
  hn::Vec<hn::ScalableTag<float>> beta1, beta2, rest1, rest2, scale1, scale2, epsilon;

  explicit HWY_INLINE Constants(const AdamBlock& b)
      : beta1(hn::Set(d, b.beta1)),
        beta2(hn::Set(d, b.beta2)),
        rest1(hn::Set(d, 1 - b.beta1)),
        rest2(hn::Set(d, 1 - b.beta2)),
        scale1(hn::Set(d, b.inverse_correction1)),
        scale2(hn::Set(d, b.inverse_correction2)),
        epsilon(hn::Set(d, b.epsilon)) {}
};

// Updates one vector of entries, at any address. Returns how many gradients are not finite.
HWY_INLINE int64_t update_lanes(const Constants& c, const float* gradient, const float* rates,
                                float* parameter, float* first, float* second) {
  const auto g = hn::LoadU(c.d, gradient);
  const auto squared = hn::Mul(g, g);
  const auto finite = hn::IsFinite(squared);
  const auto m0 = hn::LoadU(c.d, first);
  const auto v0 = hn::LoadU(c.d, second);
  const auto p0 = hn::LoadU(c.d, parameter);
  const auto m = hn::MulAdd(c.beta1, m0, hn::Mul(c.rest1, g));
  const auto v = hn::MulAdd(c.beta2, v0, hn::Mul(c.rest2, squared));
  const auto root = hn::Add(hn::Sqrt(hn::Mul(v, c.scale2)), c.epsilon);
  const auto p = hn::Sub(p0, hn::Div(hn::Mul(hn::LoadU(c.d, rates), hn::Mul(m, c.scale1)), root));
  hn::StoreU(hn::IfThenElse(finite, m, m0), c.d, first);
  hn::StoreU(hn::IfThenElse(finite, v, v0), c.d, second);
  hn::StoreU(hn::IfThenElse(finite, p, p0), c.d, parameter);
  return static_cast<int64_t>(hn::Lanes(c.d)) - static_cast<int64_t>(hn::CountTrue(c.d, finite));
}

// Updates fewer entries than a vector has, by way of a buffer: before AVX no instruction reads or writes a
// partial vector.
HWY_INLINE int64_t update_rest(const Constants& c, const AdamBlock& b, int64_t begin) {
  constexpr size_t most = hn::MaxLanes(hn::ScalableTag<float>());
  const auto count = static_cast<size_t>(b.count - begin);
  float gradient[most] = {}, rates[most] = {}, parameter[most] = {}, first[most] = {}, second[most] = {};
  std::copy_n(b.gradient + begin, count, gradient);
  std::copy_n(b.rates + begin, count, rates);
  std::copy_n(b.parameter + begin, count, parameter);
  std::copy_n(b.first + begin, count, first);
  std::copy_n(b.second + begin, count, second);
  const int64_t not_finite = update_lanes(c, gradient, rates, parameter, first, second);
  std::copy_n(parameter, count, b.parameter + begin);
  std::copy_n(first, count, b.first + begin);
  std::copy_n(second, count, b.second + begin);
  return not_finite;
}

int64_t update_block(const AdamBlock& b) {
  const Constants c(b);
  const auto lanes = static_cast<int64_t>(hn::Lanes(c.d));
  int64_t not_finite = 0, i = 0;
  for (; i + lanes <= b.count; i += lanes) {
    not_finite += update_lanes(c, b.gradient + i, b.rates + i, b.parameter + i, b.first + i, b.second + i);
  }
  if (i < b.count) not_finite += update_rest(c, b, i);
  return not_finite;
}

}  // namespace traceflow::optimize::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <array>
#include <atomic>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "ops/optimize/adam.h"

namespace traceflow::optimize {

HWY_EXPORT(update_block);

namespace {

constexpr int64_t block_size = 1 << 14;
static_assert(block_size >= most_rates);

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

// Allocates no memory, so that running out of memory cannot leave a tensor half updated.
void step_on_host(const AdamTask& task, const AdamOptions& options, LeftAlone& left_alone) {
  Tensor<float>& parameter = *task.parameter;
  const Tensor<float>& gradient = *task.gradient;
  AdamState& state = *task.state;
  const std::vector<float>& learning_rates = task.learning_rates;
  // Blocks begin at multiples of the row, so that the same rates serve all blocks.
  const auto columns = static_cast<int64_t>(learning_rates.size());
  const int64_t grain = block_size / columns * columns;
  std::array<float, block_size> rates;
  for (size_t i = 0; i < static_cast<size_t>(grain); ++i)
    rates[i] = learning_rates[i % learning_rates.size()];

  std::atomic<int64_t> not_finite{0};
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
    not_finite += HWY_DYNAMIC_DISPATCH(update_block)(block);
  });
  note(gradient, not_finite, left_alone);
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
