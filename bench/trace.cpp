#include <benchmark/benchmark.h>

#include <ctime>

#include "base/parallel.h"
#include "base/random.h"
#include "math/spherical_harmonics.h"
#include "on_device.h"
#include "ops/trace/trace.h"
#if defined(TRACEFLOW_EMBREE)
#include "trace_embree.h"
#endif

// The tracer on 100,000 surfels in a shell around a mirror ball, seen by the rays that the ball reflects into
// a camera. On the CPU: one thread, CPU time, and where Embree is, it runs in the same program on the same
// surfels and rays. On the CUDA device, where one answers: the time until all work is done; and the same for
// a frame whose pixels all reflect an environment of 75,000 surfels, with what it cannot do without.
namespace traceflow {
namespace {

struct Setting {
  int sh_degree;
  double opacity_min, opacity_max;
  int64_t surfels = 100000;
  double scale = 0.092;
};
constexpr Setting faint{3, 0.05, 0.5};       // rays cross the whole shell
constexpr Setting faint_flat{0, 0.05, 0.5};  // the same without SH
constexpr Setting opaque{3, 0.3, 0.99};      // rays end early
// About 24 blended hits a ray.
constexpr Setting environment{3, 0.05, 0.5, bench::environment_surfels, 0.106};

PosedSurfels make_shell(const Setting& setting) {
  Random random(1);
  const int64_t surfel_count = setting.surfels;
  PosedSurfels s;
  s.position.resize({surfel_count, 3});
  s.scale.resize({surfel_count, 2});
  s.rotation.resize({surfel_count, 4});
  s.opacity.resize({surfel_count});
  s.sh.resize({surfel_count, sh_coefficients(setting.sh_degree), 3});
  for (int64_t i = 0; i < surfel_count; ++i) {
    const Vec3<double> out = glm::normalize(Vec3<double>(random.normal(), random.normal(), random.normal()));
    store3(s.position.row(i), random.uniform(5, 8) * out);
    for (int k = 0; k < 2; ++k)
      s.scale(i, k) = static_cast<float>(setting.scale * std::exp(0.3 * random.normal()));
    for (int k = 0; k < 4; ++k) s.rotation(i, k) = static_cast<float>(random.normal());
    s.opacity[i] = static_cast<float>(random.uniform(setting.opacity_min, setting.opacity_max));
    for (int64_t k = 0; k < s.sh.row_size(); ++k) s.sh.row(i)[k] = static_cast<float>(0.1 * random.normal());
  }
  return s;
}

using trace::Rays;

// A camera at z = -4 looks at a ball of radius 1 whose surface is a little uneven; pixels in rows, as a
// renderer has them. The picture reaches as far as `half_width` from the ball's middle.
Rays reflect_off_ball(int width, int height, double half_width, double unevenness) {
  Random random(2);
  std::vector<Vec3<double>> origins, directions;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double px = half_width * (2 * (x + 0.5) / width - 1),
                   py = half_width * (2 * (y + 0.5) / height - 1);
      if (px * px + py * py > 0.9) continue;
      const Vec3<double> point(px, py, -std::sqrt(1 - px * px - py * py));
      const Vec3<double> noise(random.normal(), random.normal(), random.normal());
      const Vec3<double> normal = glm::normalize(point + unevenness * noise);
      const Vec3<double> in = glm::normalize(point - Vec3<double>(0, 0, -4));
      origins.push_back(point);
      directions.push_back(glm::normalize(in - 2 * dot(in, normal) * normal));
    }
  }
  const auto n = static_cast<int64_t>(origins.size());
  Rays rays{Tensor<float>({n, 3}), Tensor<float>({n, 3})};
  for (int64_t r = 0; r < n; ++r) {
    store3(rays.origins.row(r), origins[static_cast<size_t>(r)]);
    store3(rays.directions.row(r), directions[static_cast<size_t>(r)]);
  }
  return rays;
}

Rays reflect_off_ball(int size, double unevenness) { return reflect_off_ball(size, size, 1, unevenness); }

#if defined(TRACEFLOW_EMBREE)
double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

template <class F>
double fastest(int repeats, F&& f) {
  double best = std::numeric_limits<double>::max();
  for (int i = 0; i < repeats; ++i) {
    const double start = cpu_seconds();
    f();
    best = std::min(best, cpu_seconds() - start);
  }
  return best;
}

// The share of rays whose colour differs by more than 1/255: how far two tracers agree.
double share_differing(const trace::Output& a, const trace::Output& b) {
  int64_t differing = 0;
  for (int64_t r = 0; r < a.alpha.size(); ++r) {
    const Vec3<float> d = glm::abs(load3<float>(a.colour.row(r)) - load3<float>(b.colour.row(r)));
    if (!(std::max({d.x, d.y, d.z}) <= 1.0F / 255)) ++differing;
  }
  return static_cast<double>(differing) / static_cast<double>(a.alpha.size());
}

void against_embree(benchmark::State& state, const Setting& setting, double unevenness) {
  set_threads(1);
  const PosedSurfels surfels = make_shell(setting);
  const Rays rays = reflect_off_ball(256, unevenness);
  const trace::Options options;
  const bench::EmbreeTracer<16> embree16(surfels, options);
  const bench::EmbreeTracer<48> embree48(surfels, options);
  const trace::BvhPtr bvh = trace::make_bvh();
  const trace::SavedPtr saved = trace::make_saved();
  trace::build(surfels, options, *bvh);
  trace::Output own, other;
  double own_time = 1e9, time16 = 1e9, time48 = 1e9;
  for (auto _ : state) {
    own_time =
        std::min(own_time, fastest(3, [&] { trace::forward(surfels, *bvh, rays, options, own, nullptr); }));
    time16 = std::min(time16, fastest(2, [&] { embree16.forward(rays.origins, rays.directions, other); }));
    time48 = std::min(time48, fastest(2, [&] { embree48.forward(rays.origins, rays.directions, other); }));
  }
  trace::forward(surfels, *bvh, rays, options, own, saved.get());
  const auto n = static_cast<double>(rays.origins.dim(0));
  state.counters["hits_per_ray"] = static_cast<double>(trace::blended_hits(*saved)) / n;
  state.counters["Mrays/s"] = 1e-6 * n / own_time;
  state.counters["embree16_Mrays/s"] = 1e-6 * n / time16;
  state.counters["embree48_Mrays/s"] = 1e-6 * n / time48;
  state.counters["ratio16"] = time16 / own_time;
  state.counters["ratio48"] = time48 / own_time;
  state.counters["differing"] = share_differing(own, other);
}
BENCHMARK_CAPTURE(against_embree, faint, faint, 0.0)->Unit(benchmark::kMillisecond)->Iterations(3);
BENCHMARK_CAPTURE(against_embree, faint_flat, faint_flat, 0.0)->Unit(benchmark::kMillisecond)->Iterations(3);
BENCHMARK_CAPTURE(against_embree, faint_uneven, faint, 0.2)->Unit(benchmark::kMillisecond)->Iterations(3);
BENCHMARK_CAPTURE(against_embree, opaque, opaque, 0.0)->Unit(benchmark::kMillisecond)->Iterations(3);

#endif

// Rays, or cones of that width.
Rays reflect_cones(double unevenness, float width) {
  Rays rays = reflect_off_ball(256, unevenness);
  if (width > 0) rays.widths = Tensor<float>({rays.count()});
  for (float& w : rays.widths.values()) w = width;
  return rays;
}

void forward(benchmark::State& state, const Setting& setting, double unevenness, float width = 0) {
  set_threads(1);
  const PosedSurfels surfels = make_shell(setting);
  const Rays rays = reflect_cones(unevenness, width);
  trace::Options options;
  options.hits_per_pass = static_cast<int>(state.range(0));
  const trace::BvhPtr bvh = trace::make_bvh();
  trace::build(surfels, options, *bvh);
  trace::Output output;
  for (auto _ : state) {
    trace::forward(surfels, *bvh, rays, options, output, nullptr);
  }
  state.SetItemsProcessed(state.iterations() * rays.origins.dim(0));
}
BENCHMARK_CAPTURE(forward, faint, faint, 0.0)
    ->Unit(benchmark::kMillisecond)
    ->Arg(4)
    ->Arg(8)
    ->Arg(16)
    ->Arg(64);
BENCHMARK_CAPTURE(forward, faint_uneven, faint, 0.2)->Unit(benchmark::kMillisecond)->Arg(16);
BENCHMARK_CAPTURE(forward, narrow_cones, opaque, 0.0, 0.02F)->Unit(benchmark::kMillisecond)->Arg(64);
BENCHMARK_CAPTURE(forward, wide_cones, opaque, 0.0, 0.1F)->Unit(benchmark::kMillisecond)->Arg(64);
BENCHMARK_CAPTURE(forward, opaque, opaque, 0.0)
    ->Unit(benchmark::kMillisecond)
    ->Arg(4)
    ->Arg(8)
    ->Arg(16)
    ->Arg(64);

void backward(benchmark::State& state, const Setting& setting, double unevenness, float width = 0) {
  set_threads(1);
  const PosedSurfels surfels = make_shell(setting);
  const Rays rays = reflect_cones(unevenness, width);
  const trace::Options options;
  const trace::BvhPtr bvh = trace::make_bvh();
  const trace::SavedPtr saved = trace::make_saved();
  trace::build(surfels, options, *bvh);
  trace::Output output;
  trace::forward(surfels, *bvh, rays, options, output, saved.get());
  trace::OutputGradient grad{output.colour, output.alpha, output.distance};
  trace::InputGradient gradient;
  for (auto _ : state) {
    trace::backward(surfels, rays, options, *saved, grad, gradient);
  }
  state.SetItemsProcessed(state.iterations() * rays.origins.dim(0));
}
BENCHMARK_CAPTURE(backward, faint, faint, 0.0)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(backward, faint_uneven, faint, 0.2)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(backward, narrow_cones, opaque, 0.0, 0.02F)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(backward, wide_cones, opaque, 0.0, 0.1F)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(backward, opaque, opaque, 0.0)->Unit(benchmark::kMillisecond);

void build(benchmark::State& state) {
  set_threads(static_cast<int>(state.range(0)));
  const PosedSurfels surfels = make_shell(faint);
  const trace::BvhPtr bvh = trace::make_bvh();
  for (auto _ : state) trace::build(surfels, {}, *bvh);
}
BENCHMARK(build)->Unit(benchmark::kMillisecond)->Arg(1)->Arg(2)->MeasureProcessCPUTime()->UseRealTime();

// The same on the CUDA device; the argument is the picture's width, 1024 being 740,000 rays.
class OnDevice {
 public:
  OnDevice(const Setting& setting, const Rays& rays) {
    surfels_ = make_shell(setting).on(Device::cuda);
    rays_ = rays.on(Device::cuda);
    build();
    forward(saved_.get());
    grad_ = {output_.colour, output_.alpha, output_.distance};
    backward();
  }
  void build() { trace::build(surfels_, {}, *bvh_); }
  void forward(trace::Saved* saved) { trace::forward(surfels_, *bvh_, rays_, {}, output_, saved); }
  void backward() { trace::backward(surfels_, rays_, {}, *saved_, grad_, gradient_); }
  int64_t rays() const { return rays_.count(); }
  double hits_per_ray() const { return hits() / static_cast<double>(rays()); }
  trace::Saved* saved() { return saved_.get(); }

  // A disk's box and its place in the tree.
  bench::Floor build_floor() const {
    return {bench::bytes(surfels_.position, surfels_.scale, surfels_.rotation, surfels_.opacity), 0};
  }
  // A blended hit, by the formulas of math/: its place in the plane 30, its weight 10, its colour 96 and what
  // is blended 10; backward the derivatives of all of them. Walks through the tree do not count.
  bench::Floor forward_floor() const {
    return {bench::bytes(surfels_) + bench::bytes(rays_.origins, rays_.directions, output_.colour,
                                                  output_.alpha, output_.distance),
            146 * hits()};
  }
  bench::Floor backward_floor() const {
    return {bench::bytes(surfels_) + bench::bytes(gradient_.surfels) +
                bench::bytes(rays_.origins, rays_.directions, grad_.colour, grad_.alpha, grad_.distance) +
                bench::bytes(gradient_.rays.origins, gradient_.rays.directions, gradient_.position_gradient),
            400 * hits()};
  }

 private:
  double hits() const { return static_cast<double>(trace::blended_hits(*saved_)); }

  PosedSurfels surfels_;
  Rays rays_;
  trace::BvhPtr bvh_ = trace::make_bvh();
  trace::SavedPtr saved_ = trace::make_saved();
  trace::Output output_;
  trace::OutputGradient grad_;
  trace::InputGradient gradient_;
};

template <class Step>
void on_device(benchmark::State& state, const Setting& setting, double unevenness, Step&& step) {
  OnDevice tracer(setting, reflect_off_ball(static_cast<int>(state.range(0)), unevenness));
  for (auto _ : state) {
    step(tracer);
    cuda::synchronise();
  }
  state.SetItemsProcessed(state.iterations() * tracer.rays());
  state.counters["hits_per_ray"] = tracer.hits_per_ray();
}

template <class Step>
void register_on_device(const std::string& name, const Step& step) {
  const struct {
    const char* name;
    const Setting& setting;
    double unevenness;
  } scenes[] = {{"faint", faint, 0}, {"faint_uneven", faint, 0.2}, {"opaque", opaque, 0}};
  for (const auto& scene : scenes) {
    benchmark::RegisterBenchmark(
        (name + "_on_device/" + scene.name).c_str(),
        [scene, step](benchmark::State& state) { on_device(state, scene.setting, scene.unevenness, step); })
        ->Unit(benchmark::kMillisecond)
        ->Arg(256)
        ->Arg(1024)
        ->UseRealTime();
  }
}

// Before main() looks for what is registered.
[[maybe_unused]] const bool device_registered = [] {
  std::string why_not;
  if (!cuda::is_ready(why_not)) return false;
  register_on_device("build", [](OnDevice& t) { t.build(); });
  register_on_device("forward", [](OnDevice& t) { t.forward(nullptr); });
  register_on_device("forward_saved", [](OnDevice& t) { t.forward(t.saved()); });
  register_on_device("backward", [](OnDevice& t) { t.backward(); });
  register_on_device("backward_in_order", [](OnDevice& t) {
    cuda::set_deterministic(true);
    t.backward();
    cuda::set_deterministic(false);
  });
  return true;
}();

// A frame's pixels, all of which reflect.
OnDevice frame_on_device() {
  return {environment, reflect_off_ball(bench::frame_width, bench::frame_height, 0.67, 0)};
}

void trace_build_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice tracer = frame_on_device();
  bench::time_on_device(state, tracer.build_floor(), [&] { tracer.build(); });
}

void trace_forward_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice tracer = frame_on_device();
  bench::time_on_device(state, tracer.forward_floor(), [&] { tracer.forward(nullptr); });
  state.counters["hits_per_ray"] = tracer.hits_per_ray();
}

void trace_forward_saved_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice tracer = frame_on_device();
  bench::time_on_device(state, tracer.forward_floor(), [&] { tracer.forward(tracer.saved()); });
}

void trace_backward_on_device(benchmark::State& state, bool in_order) {
  if (bench::no_device(state)) return;
  OnDevice tracer = frame_on_device();
  cuda::set_deterministic(in_order);
  bench::time_on_device(state, tracer.backward_floor(), [&] { tracer.backward(); });
  cuda::set_deterministic(false);
}

BENCHMARK(trace_build_on_device)->Apply(bench::by_the_clock);
BENCHMARK(trace_forward_on_device)->Apply(bench::by_the_clock);
BENCHMARK(trace_forward_saved_on_device)->Apply(bench::by_the_clock);
BENCHMARK_CAPTURE(trace_backward_on_device, free, false)->Apply(bench::by_the_clock);
BENCHMARK_CAPTURE(trace_backward_on_device, in_order, true)->Apply(bench::by_the_clock);

}  // namespace
}  // namespace traceflow
