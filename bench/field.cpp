#include "ops/field/field.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <limits>

#include "base/parallel.h"
#include "field_work.h"
#include "on_device.h"
#include "peak.h"

// The residual field's network, forward and backward. On one core, beside what that core's multiply-add units
// can do: `of_peak` is the ratio of the two, both measured here in CPU time. And on the CUDA device.
namespace {

using namespace traceflow;

Tensor<float> random_rows(int64_t count, int64_t columns) {
  Random random(2);
  Tensor<float> rows(Shape{count, columns});
  for (float& v : rows.values()) v = static_cast<float>(random.uniform(-1, 1));
  return rows;
}

void field_forward_backward(benchmark::State& state) {
  const auto precision = state.range(1) == 16 ? field::Precision::bf16 : field::Precision::fp32;
  if (precision == field::Precision::bf16 && !field::bf16_is_fast()) {
    state.SkipWithError("no bf16 dot products on this machine");
    return;
  }
  set_threads(1);
  const int64_t points_count = state.range(2);
  const Field field = bench::trained_field(static_cast<int>(state.range(0)));
  const Tensor<float> points = random_rows(points_count, 3);
  const Tensor<float> grad_output = random_rows(points_count, field.outputs());
  Field grad_field = zeros_like<float>(field);
  Tensor<float> output;
  field::Saved saved;
  saved.memory_limit = state.range(3) << 20;
  const auto pass = [&] {
    field::forward(field, points, 0.5F, precision, output, &saved);
    field::backward(field, points, 0.5F, saved, grad_output, grad_field);
    benchmark::DoNotOptimize(grad_field.head_bias.data());
  };
  pass();  // products are compiled and memory is there from the second pass on
  const double peak = precision == field::Precision::bf16 ? bench::peak_bf16() : bench::peak_fp32();
  double seconds = std::numeric_limits<double>::infinity();
  for (auto _ : state) {
    const double start = bench::cpu_seconds();
    pass();
    seconds = std::min(seconds, bench::cpu_seconds() - start);
  }
  const bench::FieldOperations operations(field);
  const double rate =
      (operations.forward + operations.backward) * static_cast<double>(points_count) / seconds * 1e-9;
  state.counters["GFLOP/s"] = rate;
  state.counters["peak"] = peak;
  state.counters["of_peak"] = rate / peak;
  state.counters["us/point"] = seconds / static_cast<double>(points_count) * 1e6;
}

BENCHMARK(field_forward_backward)
    ->ArgNames({"width", "bits", "points", "keep_MiB"})
    ->ArgsProduct({{256, 128, 64}, {32, 16}, {16384}, {512}})
    ->Args({256, 32, 16384, 0})
    ->Args({256, 32, 2000, 512})
    ->Unit(benchmark::kMillisecond)
    ->MinTime(1);

// The paper's network on the CUDA device. Arguments: bits of the hidden layers' products, points.
class OnDevice {
 public:
  explicit OnDevice(const benchmark::State& state)
      : bits_(static_cast<int>(state.range(0))),
        points_(random_rows(state.range(1), 3).on(Device::cuda)),
        grad_output_(random_rows(state.range(1), field_.outputs()).on(Device::cuda)) {
    saved_.memory_limit = int64_t{8} << 30;  // all of it is kept
    forward(&saved_);
  }
  void forward(field::Saved* saved) {
    const auto precision = bits_ == 16 ? field::Precision::bf16 : field::Precision::fp32;
    field::forward(field_, points_, 0.5F, precision, output_, saved);
  }
  void backward() { field::backward(field_, points_, 0.5F, saved_, grad_output_, grad_field_); }
  field::Saved* saved() { return &saved_; }

  bench::Floor forward_floor() const {
    return {bench::bytes(points_, output_) + bench::bytes(field_), count() * operations_.forward, bits_};
  }
  bench::Floor backward_floor() const {
    return {bench::bytes(points_, grad_output_) + 3 * bench::bytes(field_), count() * operations_.backward,
            bits_};
  }

 private:
  double count() const { return static_cast<double>(points_.dim(0)); }

  int bits_;
  Field field_ = bench::trained_field(NetworkOptions{}.width).on(Device::cuda);
  bench::FieldOperations operations_{field_};
  Field grad_field_ = zeros_like<float>(field_);
  Tensor<float> points_, grad_output_, output_;
  field::Saved saved_;
};

void field_forward_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d(state);
  bench::time_on_device(state, d.forward_floor(), [&] { d.forward(nullptr); });
}

void field_forward_saved_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d(state);
  bench::time_on_device(state, d.forward_floor(), [&] { d.forward(d.saved()); });
}

void field_backward_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d(state);
  bench::time_on_device(state, d.backward_floor(), [&] { d.backward(); });
}

void sizes_on_device(benchmark::internal::Benchmark* b) {
  bench::by_the_clock(b);
  b->ArgNames({"bits", "points"})->ArgsProduct({{16, 32}, {bench::main_surfels, bench::environment_surfels}});
}
BENCHMARK(field_forward_on_device)->Apply(sizes_on_device);
BENCHMARK(field_forward_saved_on_device)->Apply(sizes_on_device);
BENCHMARK(field_backward_on_device)->Apply(sizes_on_device);

}  // namespace
