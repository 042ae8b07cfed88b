#include "ops/environment_map/environment_map.h"

#include "on_device.h"

// Looking up a frame's reflected directions in the cube map, on the CUDA device. Argument: pixels along a
// face's edge.
namespace traceflow {
namespace {

class OnDevice {
 public:
  explicit OnDevice(const benchmark::State& state)
      : logit_(bench::noise_on_device({6 * state.range(0), state.range(0), 3}, -1, 1, 1)),
        grad_logit_(logit_.shape(), Device::cuda) {
    forward();
  }
  void forward() { environment_map::forward(logit_, directions_, colour_); }
  void backward() {
    environment_map::backward(logit_, directions_, grad_colour_, grad_logit_, grad_directions_);
  }
  // By count: the texel's place 30, three channels of four texels each with their σ 60; more backward.
  bench::Floor forward_floor() const {
    return {bench::bytes(logit_, directions_, colour_), 90.0 * bench::frame_pixels};
  }
  bench::Floor backward_floor() const {
    return {bench::bytes(logit_, directions_, grad_colour_) + 2 * bench::bytes(grad_logit_, grad_directions_),
            200.0 * bench::frame_pixels};
  }

 private:
  const Shape rays_{bench::frame_pixels, 3};
  Tensor<float> logit_, grad_logit_, colour_;
  Tensor<float> directions_ = bench::noise_on_device(rays_, -1, 1, 2),
                grad_colour_ = bench::noise_on_device(rays_, -1, 1, 3);
  Tensor<float> grad_directions_{rays_, Device::cuda};
};

void environment_map_forward_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d(state);
  bench::time_on_device(state, d.forward_floor(), [&] { d.forward(); });
}

void environment_map_backward_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d(state);
  bench::time_on_device(state, d.backward_floor(), [&] { d.backward(); });
}

BENCHMARK(environment_map_forward_on_device)->Apply(bench::by_the_clock)->ArgName("edge")->Arg(128);
BENCHMARK(environment_map_backward_on_device)->Apply(bench::by_the_clock)->ArgName("edge")->Arg(128);

}  // namespace
}  // namespace traceflow
