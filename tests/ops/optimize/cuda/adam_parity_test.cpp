#include <limits>

#include "ops/optimize/adam.h"
#include "support/device.h"

namespace traceflow::optimize {
namespace {

using namespace traceflow::testing;

using AdamOnDevice = OnDevice;

struct Run {
  Tensor<float> parameter;
  AdamState state;
  std::vector<LeftAlone> left_alone;  // by each step
};

// Three steps with gradients of every size. spoilt: some are not finite, or have no finite square.
Run run(const Shape& shape, std::span<const float> rates, bool spoilt, Device device) {
  Random random(1);
  Run r;
  r.parameter = random_tensor<float>(shape, random, -1, 1).on(device);
  r.state = {Tensor<float>(shape, device), Tensor<float>(shape, device), 0};
  for (int step = 0; step < 3; ++step) {
    Tensor<float> gradient(shape);
    for (float& g : gradient.values())
      g = static_cast<float>(random.normal() * std::pow(10, random.uniform(-6, 6)));
    const float bad[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                         1e30F};
    if (spoilt) {
      for (int64_t i = 5 * step + 9; i < gradient.size(); i += 37) gradient[i] = bad[i % 3];
    }
    const Tensor<float> there = gradient.on(device);
    const AdamTask task{&r.parameter, &there, &r.state, {rates.begin(), rates.end()}};
    Tensor<LeftAlone> left_alone;
    adam_step({&task, 1}, {}, left_alone);
    r.left_alone.push_back(left_alone.on(Device::cpu)[0]);
  }
  return r;
}

void expect_agreement(const Shape& shape, std::span<const float> rates, bool spoilt) {
  const Run expected = run(shape, rates, spoilt, Device::cpu),
            found = run(shape, rates, spoilt, Device::cuda);
  for (size_t step = 0; step < 3; ++step) {
    EXPECT_EQ(found.left_alone[step].count, expected.left_alone[step].count);
    EXPECT_EQ(found.left_alone[step].first(), expected.left_alone[step].first());
    EXPECT_EQ(expected.left_alone[step].count > 0, spoilt);
  }
  EXPECT_EQ(found.state.step, 3);
  // The same few operations, a rounding more or less in each.
  expect_close_on_host(found.parameter, expected.parameter, 1e-6, "parameter");
  expect_close_on_host(found.state.first, expected.state.first, 1e-6, "first moment");
  expect_close_on_host(found.state.second, expected.state.second, 1e-6, "second moment");
}

TEST_F(AdamOnDevice, AgreesWithTheCpuWithOneRate) {
  const float rate = 0.1F;
  for (const bool spoilt : {false, true}) {
    for (const int64_t rows : {1, 3, 331, 9000}) {
      if (rows > 100 || !spoilt) expect_agreement({rows, 3}, {&rate, 1}, spoilt);
    }
  }
}

TEST_F(AdamOnDevice, AgreesWithTheCpuWithARateForEachColumn) {
  std::vector<float> rates(48);
  for (size_t i = 0; i < rates.size(); ++i) rates[i] = 0.01F * static_cast<float>(i);
  for (const size_t columns : {size_t{3}, size_t{7}, size_t{48}}) {
    expect_agreement({67, static_cast<int64_t>(columns)}, std::span(rates).first(columns), true);
  }
}

TEST_F(AdamOnDevice, EmptyTensorIsFine) {
  Tensor<float> parameter({0, 3}, Device::cuda);
  AdamState state{parameter, parameter, 0};
  EXPECT_EQ(adam_step(parameter, parameter, state, 0.1F, {}), 0);
}

// More tensors, and more rates, than one kernel takes; some hold nothing, the last among them.
TEST_F(AdamOnDevice, StepsManyTensorsAtOnce) {
  struct Parameter {
    Tensor<float> value, gradient;
    AdamState state;
  };
  constexpr int64_t tensors = 131, spoilt = 77;
  const auto stepped = [&](Device device, std::vector<Parameter>& parameters, Tensor<LeftAlone>& left_alone) {
    Random random(3);
    std::vector<AdamTask> tasks;
    parameters.resize(tensors);
    for (int64_t k = 0; k < tensors; ++k) {
      Parameter& p = parameters[static_cast<size_t>(k)];
      const int64_t columns = k % 10 == 0 ? most_rates : k % 4 + 1, rows = k % 7 == 4    ? 0
                                                                           : k % 13 == 1 ? 1400
                                                                                         : k % 5 + 1;
      p.value = random_tensor<float>({rows, columns}, random, -1, 1).on(device);
      Tensor<float> gradient = random_tensor<float>({rows, columns}, random, -1, 1);
      if (k == spoilt) gradient[3] = gradient[4] = std::numeric_limits<float>::quiet_NaN();
      p.gradient = gradient.on(device);
      p.state = {Tensor<float>({rows, columns}, device), Tensor<float>({rows, columns}, device), k % 3};
      tasks.push_back({&p.value, &p.gradient, &p.state, {}});
      for (int64_t c = 0; c < columns; ++c)
        tasks.back().learning_rates.push_back(static_cast<float>(random.uniform(0, 1)));
    }
    adam_step(tasks, {}, left_alone);
  };
  std::vector<Parameter> expected, found;
  Tensor<LeftAlone> expected_left_alone, found_left_alone;
  stepped(Device::cpu, expected, expected_left_alone);
  stepped(Device::cuda, found, found_left_alone);
  const Tensor<LeftAlone> noted = found_left_alone.on(Device::cpu);
  ASSERT_EQ(noted.size(), tensors);
  for (int64_t k = 0; k < tensors; ++k) {
    SCOPED_TRACE(k);
    const auto i = static_cast<size_t>(k);
    ASSERT_EQ(found[i].value.size(), expected[i].value.size());
    if (expected[i].value.empty()) continue;
    expect_close_on_host(found[i].value, expected[i].value, 1e-6, "parameter");
    expect_close_on_host(found[i].state.first, expected[i].state.first, 1e-6, "first moment");
    expect_close_on_host(found[i].state.second, expected[i].state.second, 1e-6, "second moment");
    EXPECT_EQ(found[i].state.step, k % 3 + 1);
    EXPECT_EQ(noted[k].count, k == spoilt ? 2 : 0);
    EXPECT_EQ(noted[k].first(), expected_left_alone[k].first());
  }
}

TEST_F(AdamOnDevice, RefusesParametersOnTwoDevices) {
  Tensor<float> here({4}), there({4}, Device::cuda);
  AdamState state_here{here, here, 0}, state_there{there, there, 0};
  const AdamTask tasks[] = {{&here, &here, &state_here, {1}}, {&there, &there, &state_there, {1}}};
  Tensor<LeftAlone> left_alone;
  EXPECT_THROW(adam_step(tasks, {}, left_alone), InternalError);
}

}  // namespace
}  // namespace traceflow::optimize
