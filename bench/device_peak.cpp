#include <cstddef>

#include "math/bf16.h"
#include "on_device.h"
#include "primitives/gemm.h"

// What the CUDA device can do, measured: copies within its memory, matrix products, and how soon one small
// piece of work follows another. The floors of the other benchmarks' calls rest on it (scripts/floors).
namespace traceflow {
namespace {

void copy_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  const int64_t numbers = state.range(0) << 18;
  Tensor<float> from({numbers}, Device::cuda), to({numbers}, Device::cuda);
  const double moved = bench::bytes(from, to);
  bench::time_on_device(state, {moved, 0}, [&] {
    memory::copy(Device::cuda, to.data(), Device::cuda, from.data(),
                 static_cast<size_t>(numbers) * sizeof(float));
  });
  state.counters["bytes/s"] = benchmark::Counter(moved, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(copy_on_device)->Apply(bench::by_the_clock)->ArgName("MiB")->Arg(1024);

void start_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  Tensor<float> one({1}, Device::cuda);
  bench::time_on_device(state, {bench::bytes(one), 0}, [&] { one.zero(); });
}
BENCHMARK(start_on_device)->Apply(bench::by_the_clock);

// The one place that knows the product's name. C = A·Bᵀ, as layers have it.
void multiply(int64_t m, int64_t n, int64_t k, DType number, const Tensor<std::byte>& a,
              const Tensor<std::byte>& b, Tensor<std::byte>& c) {
  cuda::multiply({.m = m,
                  .k = k,
                  .n = n,
                  .transposed_b = true,
                  .stride_a = k,
                  .stride_b = k,
                  .stride_c = n,
                  .operands = number,
                  .result = number},
                 {.a = a.data(), .b = b.data(), .c = c.data()});
}

// Uniform in [-1, 1), since zeros would be multiplied faster.
template <class T>
Tensor<std::byte> random_operand(int64_t numbers, uint64_t seed) {
  Random random(seed);
  Tensor<T> values({numbers});
  for (T& v : values.values()) v = rounded_to<T>(static_cast<float>(random.uniform(-1, 1)));
  Tensor<std::byte> bytes;
  bytes.place(Device::cuda).resize({numbers * static_cast<int64_t>(sizeof(T))});
  memory::copy(Device::cuda, bytes.data(), Device::cpu, values.data(), values.values().size_bytes());
  return bytes;
}

template <class T>
void time_product(benchmark::State& state, DType number) {
  const int64_t m = state.range(1), n = state.range(2), k = state.range(3);
  const Tensor<std::byte> a = random_operand<T>(m * k, 1), b = random_operand<T>(n * k, 2);
  Tensor<std::byte> c({m * n * static_cast<int64_t>(sizeof(T))}, Device::cuda);
  const double flops = 2.0 * static_cast<double>(m) * static_cast<double>(n) * static_cast<double>(k);
  bench::time_on_device(state, {bench::bytes(a, b, c), flops, 8 * static_cast<int>(sizeof(T))},
                        [&] { multiply(m, n, k, number, a, b, c); });
  state.counters["flop/s"] = benchmark::Counter(flops, benchmark::Counter::kIsIterationInvariantRate);
}

// A layer's product over many points; and a large one, which memory does not hold back.
void product_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  if (state.range(0) == 16) {
    time_product<Bf16>(state, DType::bf16);
  } else {
    time_product<float>(state, DType::fp32);
  }
}
BENCHMARK(product_on_device)
    ->Apply(bench::by_the_clock)
    ->ArgNames({"bits", "m", "n", "k"})
    ->ArgsProduct({{16, 32}, {131072}, {256}, {256}})
    ->ArgsProduct({{16, 32}, {8192}, {8192}, {8192}});

}  // namespace
}  // namespace traceflow
