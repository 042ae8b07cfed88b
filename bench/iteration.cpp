#include <cmath>

#include "base/parallel.h"
#include "capture/synth/synth.h"
#include "on_device.h"
#include "render/frame_kernels.h"
#include "render/renderer.h"
#include "train/initialise.h"
#include "train/objective.h"
#include "train/optimiser.h"

// One training iteration of phase 3 and one picture, on the CUDA device: everything moves, everything
// reflects, everything learns, with the paper's networks and losses at 480×270.
namespace traceflow {
namespace {

constexpr int views = 16;

// The synthetic room with its balls, as dense as it becomes late in training.
struct WholeScene {
  TrainOptions options = preset("paper");
  Scene scene;
  std::vector<View> shots;
  ViewImages target;

  WholeScene(int64_t main, int64_t environment) {
    SynthOptions synth;
    synth.points = static_cast<int>(main);
    synth.samples = 1;
    synth.width = bench::frame_width;
    synth.height = bench::frame_height;
    synth.frames = views;
    const std::vector<SynthView> seen = synth_views(synth);
    const SceneNormalisation world = synth_normalisation();
    for (const SynthView& view : seen) {
      View shot{"", static_cast<float>(shots.size()) / (views - 1), convert<float>(view.camera)};
      shot.camera.position = Vec3<float>((view.camera.position - world.centre) * world.scale);
      shots.push_back(shot);
    }
    Tensor<float> points = synth_points(synth);
    for (int64_t i = 0; i < points.dim(0); ++i) {
      store3(points.row(i), (load3<double>(points.row(i)) - world.centre) * world.scale);
    }
    Random random(1);
    options.initial.opacity = 0.5F;
    options.initial.tint = 0.3F;
    options.initial.environment_opacity = 0.1F;
    options.initial.environment_cells =
        static_cast<int>(std::ceil(std::cbrt(static_cast<double>(environment) / 5)));
    scene.main = surfels_at_points(points, options.initial, random);
    scene.environment = surfels_around(points, shots, environment, options.initial, random);
    scene.main_field = moving_field(residual::main_outputs, random);
    scene.environment_field = moving_field(residual::environment_outputs, random);
    target.colour = synth_images(synth, seen.front()).colour;
    target.normal_prior = Tensor<float>(target.colour.shape());
    for (int64_t i = 2; i < target.normal_prior.size(); i += 3) target.normal_prior[i] = -1;
  }

  void move_to(Device device) {
    scene.move_to(device);
    target.colour = target.colour.on(device);
    target.normal_prior = target.normal_prior.on(device);
  }
  FrameRequest request(size_t k) const {
    FrameRequest request;
    request.camera = shots[k % shots.size()].camera;
    request.time = shots[k % shots.size()].time;
    return request;
  }

 private:
  Field moving_field(int outputs, Random& random) const {
    Field field = make_field(options.deform.network, outputs, random);
    for (float& w : field.head_weight.values()) w = static_cast<float>(random.uniform(-1e-3, 1e-3));
    return field;
  }
};

void tell(benchmark::State& state, const Frame& frame) {
  state.counters["traced_pixels"] = static_cast<double>(frame.traced.pixel.size());
  state.counters["device_MiB"] = static_cast<double>(memory::most_device_bytes() >> 20);
}

void iteration_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  WholeScene s(state.range(0), state.range(1));
  s.move_to(Device::cuda);
  cuda::set_deterministic(state.range(2) != 0);
  const Schedule schedule(s.options);
  Renderer renderer(s.options.render, {.field_bytes = int64_t{4} << 30, .hit_bytes = int64_t{4} << 30});
  Optimiser optimiser(s.scene);
  SceneGradient gradient;
  FrameGradient grad_frame;
  LossMeans means;
  Tensor<float> grad_rest;
  const Trainable trainable{.camera = false};
  size_t k = 0;
  const auto step = [&] {
    FrameRequest request = s.request(k++);
    request.pseudo_normals = request.probes = request.cull = true;
    request.probe_seed = k;
    const Frame& frame = renderer.forward(s.scene, request, true);
    evaluate_objective({frame, s.target, s.options.loss, NormalLosses::more_on_mirrors},
                       {grad_frame, grad_rest}, means);
    benchmark::DoNotOptimize(means.read());
    gradient.reset(s.scene);
    renderer.backward(s.scene, request, trainable, grad_frame, gradient);
    // Rates of nothing, so that every iteration sees the same scene.
    RateOptions rates = s.options.rates;
    rates.position = rates.position_end = rates.field = rates.field_end = 1e-30F;
    rates.sh = rates.opacity = rates.log_scale = rates.rotation = rates.tint = 1e-30F;
    optimiser.step(s.scene, gradient, trainable, schedule, rates, 0);
    benchmark::DoNotOptimize(optimiser.left_alone());
    parallel_for(Device::cuda, "train: follow the displacement", 1,
                 FollowMaxDisplacement{frame.max_displacement.data(), s.scene.main_max_displacement.data()});
    if (k == 1) tell(state, frame);
  };
  for (int i = 0; i < views; ++i) step();
  for (auto _ : state) step();
  state.counters["device_MiB"] = static_cast<double>(memory::most_device_bytes() >> 20);
  cuda::set_deterministic(false);
}
BENCHMARK(iteration_on_device)
    ->Apply(bench::by_the_clock)
    ->ArgNames({"main", "environment", "deterministic"})
    ->Args({bench::main_surfels, bench::environment_surfels, 0})
    ->Args({bench::main_surfels, bench::environment_surfels, 1});

// Time changes every frame, so that nothing of the frame before serves this one.
void render_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  WholeScene s(state.range(0), state.range(1));
  s.move_to(Device::cuda);
  Renderer renderer(s.options.render);
  size_t k = 0;
  const auto draw = [&] {
    const Frame& frame = renderer.forward(s.scene, s.request(k++));
    cuda::synchronise();
    if (k == 1) tell(state, frame);
  };
  for (int i = 0; i < views; ++i) draw();
  for (auto _ : state) draw();
  state.counters["frames/s"] = benchmark::Counter(1, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(render_on_device)
    ->Apply(bench::by_the_clock)
    ->ArgNames({"main", "environment"})
    ->Args({bench::main_surfels, bench::environment_surfels});

}  // namespace
}  // namespace traceflow
