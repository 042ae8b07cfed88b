#include <benchmark/benchmark.h>

#include "base/parallel.h"
#include "capture/synth/synth.h"
#include "render/renderer.h"
#include "train/initialise.h"
#include "train/objective.h"
#include "train/optimiser.h"

// One iteration of a static scene (raster forward and backward, L1 + SSIM, Adam) on 12,700 surfels at
// 240×135, on one thread: what a splatting trainer does without reflections and motion. Times are CPU times.
namespace traceflow {
namespace {

constexpr int surfels = 12700;

// The synthetic balls, photographed once, and surfels at their points as training starts with, after
// `opacity` has grown.
struct StaticScene {
  TrainOptions options = preset("cpu");
  Scene scene;
  FrameRequest request;
  ViewImages target;

  explicit StaticScene(float opacity) {
    SynthOptions synth;
    synth.points = surfels;
    synth.samples = 4;
    const SynthView view = synth_views(synth).front();
    target.colour = synth_images(synth, view).colour;
    const SceneNormalisation world = synth_normalisation();
    Tensor<float> points = synth_points(synth);
    for (int64_t i = 0; i < points.dim(0); ++i) {
      store3(points.row(i), (load3<double>(points.row(i)) - world.centre) * world.scale);
    }
    Random random(1);
    options.initial.opacity = opacity;
    options.initial.sh_degree = 3;
    scene.specular = Specular::none;
    scene.main = surfels_at_points(points, options.initial, random);
    request.camera = convert<float>(view.camera);
    request.camera.position = Vec3<float>((view.camera.position - world.centre) * world.scale);
    request.specular = false;
  }
};

void static_iteration(benchmark::State& state) {
  set_threads(1);
  StaticScene s(static_cast<float>(state.range(0)) / 100);
  const Schedule schedule(s.options);
  Renderer renderer(s.options.render);
  Optimiser optimiser(s.scene);
  SceneGradient gradient;
  FrameGradient grad_frame;
  LossMeans means;
  Tensor<float> grad_rest;
  Trainable trainable{.main = true,
                      .tint = false,
                      .main_field = false,
                      .environment = false,
                      .environment_field = false,
                      .camera = false};
  for (auto _ : state) {
    const Frame& frame = renderer.forward(s.scene, s.request, true);
    evaluate_objective({frame, s.target, s.options.loss, NormalLosses::none}, {grad_frame, grad_rest}, means);
    benchmark::DoNotOptimize(means.read());
    gradient.reset(s.scene);
    renderer.backward(s.scene, s.request, trainable, grad_frame, gradient);
    optimiser.step(s.scene, gradient, trainable, schedule, s.options.rates, 0);
  }
  state.counters["surfels"] = static_cast<double>(s.scene.main.count());
  set_threads(0);
}
BENCHMARK(static_iteration)->Arg(10)->Arg(50)->Unit(benchmark::kMillisecond)->ArgName("opacity%");

}  // namespace
}  // namespace traceflow
