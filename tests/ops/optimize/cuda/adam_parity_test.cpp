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
    Tensor<LeftAlone> notes({3}, device);
    adam_step(r.parameter, gradient.on(device), r.state, rates, {}, {notes, 1});
    r.left_alone.push_back(notes.on(Device::cpu)[1]);
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

TEST_F(AdamOnDevice, RefusesNotesThatLieElsewhere) {
  Tensor<float> parameter({4}, Device::cuda);
  AdamState state{parameter, parameter, 0};
  Tensor<LeftAlone> notes({1});
  const float rate = 1;
  EXPECT_THROW(adam_step(parameter, parameter, state, {&rate, 1}, {}, {notes, 0}), InternalError);
}

}  // namespace
}  // namespace traceflow::optimize
