#include "ops/deform/deform.h"

#include "field_work.h"
#include "on_device.h"

// Posing surfels on the CUDA device. Arguments: surfels; bits of the field's products, 0 for no field.
namespace traceflow {
namespace {

class OnDevice {
 public:
  explicit OnDevice(const benchmark::State& state) : bits_(static_cast<int>(state.range(1))) {
    const int64_t count = state.range(0);
    const bool is_main = count == bench::main_surfels;
    stored_ = bench::surfels_on_device(count, is_main, 1);
    if (bits_ != 0) {
      field_ = bench::trained_field(NetworkOptions{}.width,
                                    is_main ? residual::main_outputs : residual::environment_outputs)
                   .on(Device::cuda);
      grad_field_ = zeros_like<float>(field_);
    }
    saved_.field.memory_limit = int64_t{8} << 30;
    grad_stored_ = zeros_like<float>(stored_);
    forward();
    grad_posed_ = posed_;
  }
  void forward() {
    const auto precision = bits_ == 16 ? field::Precision::bf16 : field::Precision::fp32;
    deform::forward(stored_, field(), 0.5F, {}, 3, precision, posed_, &saved_);
  }
  void backward() {
    deform::backward(stored_, field(), 0.5F, {}, posed_, saved_, grad_posed_, {}, grad_stored_,
                     bits_ != 0 ? &grad_field_ : nullptr);
  }

  // The activations' arithmetic is little beside the field's.
  bench::Floor forward_floor() const {
    return {bench::bytes(stored_) + bench::bytes(posed_) + bench::bytes(field_),
            count() * per_point().forward, bits()};
  }
  bench::Floor backward_floor() const {
    // Positions and harmonics pass on what they get.
    const double read = bench::bytes(grad_posed_) + bench::bytes(posed_.scale, posed_.opacity, posed_.tint);
    return {read + 2 * bench::bytes(grad_stored_) + 3 * bench::bytes(field_), count() * per_point().backward,
            bits()};
  }

 private:
  const Field* field() const { return bits_ != 0 ? &field_ : nullptr; }
  double count() const { return static_cast<double>(stored_.count()); }
  int bits() const { return bits_ != 0 ? bits_ : 32; }
  bench::FieldOperations per_point() const {
    return bits_ != 0 ? bench::FieldOperations(field_) : bench::FieldOperations();
  }

  int bits_;
  Surfels stored_, grad_stored_;
  Field field_, grad_field_;
  PosedSurfels posed_, grad_posed_;
  deform::Saved saved_;
};

void deform_forward_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d(state);
  bench::time_on_device(state, d.forward_floor(), [&] { d.forward(); });
}

void deform_backward_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d(state);
  bench::time_on_device(state, d.backward_floor(), [&] { d.backward(); });
}

void sizes(benchmark::internal::Benchmark* b) {
  bench::by_the_clock(b);
  b->ArgNames({"surfels", "bits"})
      ->ArgsProduct({{bench::main_surfels, bench::environment_surfels}, {0, 16, 32}});
}
BENCHMARK(deform_forward_on_device)->Apply(sizes);
BENCHMARK(deform_backward_on_device)->Apply(sizes);

}  // namespace
}  // namespace traceflow
