#include <memory>

#include "field_work.h"
#include "on_device.h"
#include "ops/optimize/adam.h"

// A step of Adam on the CUDA device: all groups of a set of surfels, and a field's parameters.
namespace traceflow {
namespace {

// Parameters, their gradients and moments, group by group.
class OnDevice {
 public:
  void add(const Tensor<float>& parameter) {
    const Shape& shape = parameter.shape();
    groups_.push_back(std::make_unique<Group>(
        Group{parameter,
              bench::noise_on_device(shape, -1, 1, groups_.size()),
              {Tensor<float>(shape, Device::cuda), Tensor<float>(shape, Device::cuda), 0}}));
    Group& group = *groups_.back();
    tasks_.push_back({&group.parameter, &group.gradient, &group.state, {1e-3F}});
    floor_bytes_ += 7 * bench::bytes(parameter);  // parameter and moments come and go, the gradient comes
    numbers_ += static_cast<double>(parameter.size());
  }
  void step() { optimize::adam_step(tasks_, {}, notes_); }
  // Twelve operations a number, by count.
  bench::Floor floor() const { return {floor_bytes_, 12 * numbers_}; }

 private:
  struct Group {
    Tensor<float> parameter, gradient;
    optimize::AdamState state;
  };
  std::vector<std::unique_ptr<Group>> groups_;
  std::vector<optimize::AdamTask> tasks_;
  Tensor<optimize::LeftAlone> notes_;
  double floor_bytes_ = 0, numbers_ = 0;
};

void adam_surfels_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d;
  bench::surfels_on_device(state.range(0), state.range(0) == bench::main_surfels, 1)
      .for_each([&](const std::string&, const Tensor<float>& group) { d.add(group); });
  bench::time_on_device(state, d.floor(), [&] { d.step(); });
}
BENCHMARK(adam_surfels_on_device)->Apply(bench::both_sets);

void adam_field_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d;
  bench::trained_field(NetworkOptions{}.width)
      .on(Device::cuda)
      .for_each([&](const std::string&, const Tensor<float>& group) { d.add(group); });
  bench::time_on_device(state, d.floor(), [&] { d.step(); });
}
BENCHMARK(adam_field_on_device)->Apply(bench::by_the_clock);

}  // namespace
}  // namespace traceflow
