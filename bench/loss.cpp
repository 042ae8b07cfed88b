#include "ops/loss/loss.h"

#include <benchmark/benchmark.h>

#include "base/parallel.h"
#include "base/random.h"
#include "on_device.h"
#include "ops/loss/rigidity.h"
#include "scene/neighbours.h"

// The image terms of the loss, forward and backward, on one core. Arguments: width, height. And every term on
// the CUDA device.
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

// term(image, target, gradient, other gradient, slot) on pictures of a frame that have `channels` numbers a
// pixel.
template <class F>
void measure_on_device(benchmark::State& state, int64_t channels, const bench::Floor& floor, F&& term) {
  const Shape shape{bench::frame_height, bench::frame_width, channels};
  const Tensor<float> image = bench::noise_on_device(shape, -1, 1, 1),
                      target = bench::noise_on_device(shape, -1, 1, 2);
  Tensor<float> gradient(shape, Device::cuda), other(shape, Device::cuda);
  Tensor<loss::Mean> list({1}, Device::cuda);
  bench::time_on_device(state, floor, [&] { term(image, target, gradient, other, loss::MeanSlot{list, 0}); });
}

// Of a term that reads and writes so many pictures of three channels.
bench::Floor floor_of(double pictures, double flops_a_number) {
  const double numbers = 3.0 * static_cast<double>(bench::frame_pixels);
  return {pictures * numbers * sizeof(float), flops_a_number * numbers};
}

void l1_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  measure_on_device(state, 3, floor_of(4, 4),
                    [](const auto& image, const auto& target, auto& gradient, auto&, const auto& slot) {
                      loss::l1(image, target, 0.8, gradient, slot);
                    });
}

// Four moments forward and three derivatives backward, each two sums of eleven products.
void ssim_loss_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  measure_on_device(state, 3, floor_of(4, 7 * 2 * 11 * 2),
                    [](const auto& image, const auto& target, auto& gradient, auto&, const auto& slot) {
                      loss::ssim_loss(image, target, 0.2, gradient, slot);
                    });
}

// The host waits for the figure.
void ssim_metric_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  measure_on_device(state, 3, floor_of(2, 4 * 2 * 11 * 2),
                    [](const auto& image, const auto& target, auto&, auto&, const auto&) {
                      benchmark::DoNotOptimize(loss::ssim(image, target, {}));
                    });
}

void normal_consistency_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  const Shape shape{bench::frame_height, bench::frame_width};
  const Tensor<float> alpha = bench::noise_on_device(shape, 0, 1, 3);
  Tensor<float> grad_alpha(shape, Device::cuda);
  measure_on_device(
      state, 3, floor_of(7, 7),
      [&](const auto& normal, const auto& pseudo, auto& gradient, auto& other, const auto& slot) {
        loss::normal_consistency(normal, alpha, pseudo, 0.05, gradient, grad_alpha, other, slot);
      });
}

void normal_prior_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  measure_on_device(state, 3, floor_of(4, 10),
                    [](const auto& normal, const auto& prior, auto& gradient, auto&, const auto& slot) {
                      loss::normal_prior(normal, prior, {}, 1, 0.05, gradient, slot);
                    });
}

void distortion_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  measure_on_device(state, 1, floor_of(1, 2.0 / 3),
                    [](const auto& map, const auto&, auto& gradient, auto&, const auto& slot) {
                      loss::distortion(map, 100, gradient, slot);
                    });
}

void squared_error_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  measure_on_device(state, 3, floor_of(2, 3),
                    [](const auto& image, const auto& target, auto&, auto&, const auto& slot) {
                      loss::squared_error(image, target, {}, slot);
                    });
}

void rigidity_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  constexpr int neighbours = 8;
  const Tensor<float> rest = bench::noise_on_device({bench::main_surfels, 3}, -1, 1, 1),
                      posed = bench::noise_on_device({bench::main_surfels, 3}, -1, 1, 1);
  const Neighbours found = nearest_neighbours(rest.on(Device::cpu), neighbours);
  const Neighbours edges{found.index.on(Device::cuda), found.distance2.on(Device::cuda)};
  Tensor<float> grad_rest(rest.shape(), Device::cuda), grad_posed(rest.shape(), Device::cuda);
  Tensor<loss::Mean> list({1}, Device::cuda);
  const double lengths = 60;  // and what follows from them, an edge, by count
  const bench::Floor floor{bench::bytes(rest, posed, edges.index) + 2 * bench::bytes(grad_rest, grad_posed),
                           lengths * static_cast<double>(edges.index.size())};
  bench::time_on_device(state, floor, [&] {
    loss::rigidity(rest, posed, {}, edges, 0.1, 0.1, grad_rest, grad_posed, loss::MeanSlot{list, 0});
  });
}

BENCHMARK(l1_on_device)->Apply(bench::by_the_clock);
BENCHMARK(ssim_loss_on_device)->Apply(bench::by_the_clock);
BENCHMARK(ssim_metric_on_device)->Apply(bench::by_the_clock);
BENCHMARK(normal_consistency_on_device)->Apply(bench::by_the_clock);
BENCHMARK(normal_prior_on_device)->Apply(bench::by_the_clock);
BENCHMARK(distortion_on_device)->Apply(bench::by_the_clock);
BENCHMARK(squared_error_on_device)->Apply(bench::by_the_clock);
BENCHMARK(rigidity_on_device)->Apply(bench::by_the_clock);

}  // namespace
}  // namespace traceflow
