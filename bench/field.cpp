#include "ops/field/field.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <limits>

#include "base/parallel.h"
#include "peak.h"

// The residual field's network, forward and backward, on one core, beside what that core's multiply-add units
// can do: `of_peak` is the ratio of the two, both measured here in CPU time.
namespace {

using namespace traceflow;

// Floating-point operations that one point needs: a multiplication and an addition for every weight of the
// point's encoding and of the hidden values in every layer, once forward and, but for layer 0's and the
// skip's encoding (no gradient by the input), twice backward. Padding, the time's part and ReLU do not count.
double useful_operations(const Field& field) {
  const NetworkOptions& shape = field.shape;
  const double encoding = 3 + 6 * shape.position_frequencies;
  double forward = field.outputs() * shape.width, by_input = forward;
  for (int layer = 0; layer < shape.depth; ++layer) {
    const double hidden = layer == 0 ? 0 : shape.width;
    const double seen = layer == 0 || layer == shape.skip ? encoding : 0;
    forward += (hidden + seen) * shape.width;
    by_input += hidden * shape.width;
  }
  return 2 * (2 * forward + by_input);
}

Field trained_field(int width) {
  Random random(1);
  Field field = make_field({.width = width}, residual::main_outputs, random);
  for (float& w : field.head_weight.values()) w = static_cast<float>(random.uniform(-0.1, 0.1));
  return field;
}

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
  const Field field = trained_field(static_cast<int>(state.range(0)));
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
  const double rate = useful_operations(field) * static_cast<double>(points_count) / seconds * 1e-9;
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

}  // namespace
