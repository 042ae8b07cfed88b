#include <benchmark/benchmark.h>

#include <cmath>

#include "capture/synth/synth.h"
#include "render/renderer.h"
#include "train/initialise.h"
#include "viz/ellipses.h"
#include "viz/probe.h"

// What a viewer waits for on the CPU: frames while only the camera moves, with the pose made anew or reused,
// one pixel's probe, and surfels as ellipses.
namespace traceflow {
namespace {

// The synthetic room with its balls, both sets moving by the fields of the preset `cpu`.
struct SeenScene {
  TrainOptions options = preset("cpu");
  Scene scene;
  FrameRequest request;

  SeenScene(int main, int64_t environment, int64_t width) {
    SynthOptions synth;
    synth.points = main;
    synth.samples = 1;
    synth.frames = 8;
    synth.width = static_cast<int>(width);
    synth.height = static_cast<int>(width * 9 / 16);
    const SceneNormalisation world = synth_normalisation();
    std::vector<View> shots;
    for (const SynthView& view : synth_views(synth)) {
      shots.push_back({"", 0.5F, convert<float>(view.camera)});
      shots.back().camera.position = Vec3<float>((view.camera.position - world.centre) * world.scale);
    }
    request.camera = shots.front().camera;
    request.time = 0.5F;
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
    scene.main_field = make_field(options.deform.network, residual::main_outputs, random);
    scene.environment_field =
        make_field(options.deform.environment_network, residual::environment_outputs, random);
  }
};

void moving_camera(benchmark::State& state) {
  SeenScene s(20000, 8000, state.range(0));
  Renderer renderer(s.options.render);
  renderer.forward(s.scene, s.request);
  s.request.reuse_pose = state.range(1) != 0;
  s.request.specular = state.range(2) != 0;
  for (auto _ : state) {
    s.request.camera.position.x += 1e-4F;
    benchmark::DoNotOptimize(renderer.forward(s.scene, s.request).colour.data());
  }
}
BENCHMARK(moving_camera)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->ArgNames({"width", "reuse", "specular"})
    ->ArgsProduct({{240, 480, 960}, {0, 1}, {0, 1}});

void probe(benchmark::State& state) {
  SeenScene s(20000, 8000, 960);
  Renderer renderer(s.options.render);
  s.request.reuse_pose = state.range(0) != 0;
  for (auto _ : state) benchmark::DoNotOptimize(viz::probe(renderer, s.scene, s.request, 480, 270));
}
BENCHMARK(probe)->Unit(benchmark::kMillisecond)->UseRealTime()->ArgName("reuse")->Arg(0)->Arg(1);

void ellipses(benchmark::State& state) {
  const SeenScene s(static_cast<int>(state.range(0)), 8, 960);
  PosedSurfels posed;
  deform::forward(s.scene.main, nullptr, 0, {}, 1, field::Precision::fp32, posed, nullptr);
  for (auto _ : state) benchmark::DoNotOptimize(viz::surfel_ellipses(posed, s.request.camera, {}).data());
}
BENCHMARK(ellipses)->Unit(benchmark::kMillisecond)->UseRealTime()->Arg(20000)->Arg(200000);

}  // namespace
}  // namespace traceflow
