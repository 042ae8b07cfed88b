#include "ops/loss/loss.h"

#include <benchmark/benchmark.h>

#include "base/parallel.h"
#include "base/random.h"

// The image terms of the loss, forward and backward, on one core. Arguments: width, height.

namespace traceflow {
namespace {

Tensor<float> noise(int64_t height, int64_t width, uint64_t seed) {
  Random random(seed);
  Tensor<float> image({height, width, 3});
  for (float& v : image.values()) v = static_cast<float>(random.uniform());
  return image;
}

template <class F>
void measure(benchmark::State& state, F&& term) {
  set_threads(1);
  const Tensor<float> image = noise(state.range(1), state.range(0), 1),
                      target = noise(state.range(1), state.range(0), 2);
  Tensor<float> gradient(image.shape());
  for (auto _ : state) benchmark::DoNotOptimize(term(image, target, gradient));
  state.SetItemsProcessed(state.iterations() * image.size());
  set_threads(0);
}

void l1(benchmark::State& state) {
  measure(state, [](const auto& image, const auto& target, auto& gradient) {
    return loss::value_of(Device::cpu,
                          [&](const auto& slot) { loss::l1(image, target, 0.8, gradient, slot); });
  });
}

void ssim_loss(benchmark::State& state) {
  measure(state, [](const auto& image, const auto& target, auto& gradient) {
    return loss::value_of(Device::cpu,
                          [&](const auto& slot) { loss::ssim_loss(image, target, 0.2, gradient, slot); });
  });
}

void ssim_metric(benchmark::State& state) {
  measure(state, [](const auto& image, const auto& target, auto&) { return loss::ssim(image, target, {}); });
}

void sizes(benchmark::internal::Benchmark* b) {
  b->Args({240, 135})->Args({480, 270})->Args({960, 540})->Unit(benchmark::kMillisecond);
}

BENCHMARK(l1)->Apply(sizes);
BENCHMARK(ssim_loss)->Apply(sizes);
BENCHMARK(ssim_metric)->Apply(sizes);

}  // namespace
}  // namespace traceflow
