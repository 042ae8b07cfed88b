#include <benchmark/benchmark.h>

#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <utility>

#include "base/parallel.h"
#include "base/random.h"
#include "math/rotation.h"
#include "math/spherical_harmonics.h"
#include "on_device.h"
#include "ops/raster/raster.h"

// How fast the rasteriser is on one core, and on the CUDA device. The scene is like a trained capture:
// surfels that lie on the walls of a room and on a ball in its middle, seen from inside the room; their size
// falls with their count, so that they cover the surfaces about as often at any count. Rates are of pairs of
// a pixel and a surfel: `evaluated` are those whose Gaussian is computed, `listed` those that a rasteriser
// without the cull per block of pixels would have to compute.
namespace traceflow::raster {
namespace {

struct Frame {
  PosedSurfels surfels;
  Camera<float> camera;
  OutputGradient gradient;
};

// A point of the room's walls (a cube of side 4) or of the ball (radius 0.8) and its normal.
std::pair<Vec3<double>, Vec3<double>> surface_point(Random& random) {
  if (random.uniform() < 0.3) {
    const double z = random.uniform(-1, 1);
    const double angle = random.uniform(0, 2 * std::numbers::pi);
    const Vec3<double> n(std::sqrt(1 - z * z) * std::cos(angle), std::sqrt(1 - z * z) * std::sin(angle), z);
    return {0.8 * n, n};
  }
  const auto axis = static_cast<int>(random.below(3));
  Vec3<double> p(random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(-2, 2));
  Vec3<double> n(0.0);
  n[axis] = random.uniform() < 0.5 ? -1 : 1;
  p[axis] = -2 * n[axis];
  return {p, n};
}

// The turn that takes z to n.
Vec4<double> towards(const Vec3<double>& n) { return normalize(Vec4<double>(1 + n.z + 1e-9, -n.y, n.x, 0)); }

PosedSurfels room(int64_t count) {
  Random random(1);
  PosedSurfels s;
  s.position = Tensor<float>({count, 3});
  s.scale = Tensor<float>({count, 2});
  s.rotation = Tensor<float>({count, 4});
  s.opacity = Tensor<float>({count});
  s.sh = Tensor<float>({count, sh_coefficients(3), 3});
  s.tint = Tensor<float>({count});
  const double size = 1.1 * std::sqrt(100.0 / static_cast<double>(count));
  for (int64_t i = 0; i < count; ++i) {
    auto [p, n] = surface_point(random);
    p += 0.02 * random.normal() * n;
    n = normalize(n + 0.1 * Vec3<double>(random.normal(), random.normal(), random.normal()));
    store3(s.position.row(i), p);
    const auto q = towards(n);
    for (int a = 0; a < 4; ++a) s.rotation(i, a) = static_cast<float>(q[a]);
    for (int a = 0; a < 2; ++a)
      s.scale(i, a) = static_cast<float>(size * std::exp(0.6 * random.normal() - 0.9));
    s.opacity[i] = static_cast<float>(1 / (1 + std::exp(-1.5 * random.normal() - 0.5)));
    for (int c = 0; c < 48; ++c) s.sh.row(i)[c] = static_cast<float>((c < 3 ? 0.8 : 0.1) * random.normal());
    s.tint[i] = static_cast<float>(random.uniform());
  }
  return s;
}

Frame make_frame(int64_t count, int width) {
  Frame frame;
  frame.surfels = room(count);
  const int height = width * 9 / 16;
  const auto focal = static_cast<float>(0.8 * width);
  // From (0, 0, -1.9), towards +z.
  frame.camera = {width,
                  height,
                  focal,
                  focal,
                  0.5F * static_cast<float>(width),
                  0.5F * static_cast<float>(height),
                  Mat3<float>(1.0F),
                  Vec3<float>(0, 0, -1.9F)};
  Random random(2);
  auto& g = frame.gradient;
  for (auto* t : {&g.alpha, &g.tint, &g.depth}) *t = Tensor<float>({height, width});
  for (auto* t : {&g.colour, &g.normal}) *t = Tensor<float>({height, width, 3});
  for (auto* t : {&g.alpha, &g.tint, &g.depth, &g.colour, &g.normal}) {
    for (float& v : t->values()) v = static_cast<float>(random.normal());
  }
  return frame;
}

const Frame& frame_of(const benchmark::State& state) {
  static std::map<std::pair<int64_t, int64_t>, Frame> frames;
  const auto key = std::make_pair(state.range(0), state.range(1));
  const auto found = frames.find(key);
  if (found != frames.end()) return found->second;
  return frames.emplace(key, make_frame(key.first, static_cast<int>(key.second))).first->second;
}

void count(benchmark::State& state, const Saved& saved) {
  const Work done = work(saved);
  const auto rate = [](int64_t pairs) {
    return benchmark::Counter(static_cast<double>(pairs), benchmark::Counter::kIsIterationInvariantRate);
  };
  state.counters["evaluated/s"] = rate(done.evaluated);
  state.counters["listed/s"] = rate(done.listed);
}

void forward_one_core(benchmark::State& state) {
  set_threads(1);
  const Frame& frame = frame_of(state);
  const auto saved = make_saved();
  Output output;
  for (auto step : state) forward(frame.surfels, frame.camera, {}, output, saved.get());
  count(state, *saved);
}

void backward_one_core(benchmark::State& state) {
  set_threads(1);
  const Frame& frame = frame_of(state);
  const auto saved = make_saved();
  Output output;
  InputGradient gradient;
  forward(frame.surfels, frame.camera, {}, output, saved.get());
  for (auto step : state) backward(frame.surfels, frame.camera, {}, *saved, frame.gradient, gradient);
  count(state, *saved);
}

void sizes(benchmark::internal::Benchmark* b) {
  b->Unit(benchmark::kMillisecond)->ArgNames({"surfels", "width"});
  b->Args({12700, 240})->Args({12700, 480})->Args({50000, 240})->Args({50000, 480});
}
BENCHMARK(forward_one_core)->Apply(sizes);
BENCHMARK(backward_one_core)->Apply(sizes);

// The same on the CUDA device.
class OnDevice {
 public:
  explicit OnDevice(SortOrder sort) {
    Frame frame = make_frame(bench::main_surfels, bench::frame_width);
    options_.sort = sort;
    camera_ = frame.camera;
    surfels_ = frame.surfels.on(Device::cuda);
    auto& g = frame.gradient;
    for (auto* t : {&g.alpha, &g.tint, &g.depth, &g.colour, &g.normal}) *t = t->on(Device::cuda);
    grad_ = std::move(frame.gradient);
    gradient_.wants_camera = false;
    forward(saved_.get());
    backward();
  }
  void forward(Saved* saved) { raster::forward(surfels_, camera_, options_, output_, saved); }
  void backward() { raster::backward(surfels_, camera_, options_, *saved_, grad_, gradient_); }
  Saved* saved() { return saved_.get(); }

  // A pair of a pixel and a surfel, by the formulas of math/: the footprint 20, its weight 10, eight blended
  // numbers 16; backward the derivatives of all of them.
  bench::Floor forward_floor() const {
    return {bench::bytes(surfels_) + bench::bytes(output_.colour, output_.alpha, output_.tint, output_.normal,
                                                  output_.depth, output_.median_depth, output_.distortion),
            46 * pairs()};
  }
  bench::Floor backward_floor() const {
    return {bench::bytes(surfels_) +
                bench::bytes(grad_.colour, grad_.alpha, grad_.tint, grad_.normal, grad_.depth) +
                bench::bytes(gradient_.surfels) + bench::bytes(gradient_.screen_gradient),
            150 * pairs()};
  }
  double pairs() const { return static_cast<double>(work(*saved_).evaluated); }

 private:
  PosedSurfels surfels_;
  Camera<float> camera_;
  Options options_;
  OutputGradient grad_;
  InputGradient gradient_;
  Output output_;
  SavedPtr saved_ = make_saved();
};

void raster_forward_on_device(benchmark::State& state, SortOrder sort) {
  if (bench::no_device(state)) return;
  OnDevice d(sort);
  bench::time_on_device(state, d.forward_floor(), [&] { d.forward(nullptr); });
}

void raster_forward_saved_on_device(benchmark::State& state, SortOrder sort) {
  if (bench::no_device(state)) return;
  OnDevice d(sort);
  bench::time_on_device(state, d.forward_floor(), [&] { d.forward(d.saved()); });
  state.counters["pairs_per_pixel"] = d.pairs() / static_cast<double>(bench::frame_pixels);
}

void raster_backward_on_device(benchmark::State& state, SortOrder sort) {
  if (bench::no_device(state)) return;
  OnDevice d(sort);
  bench::time_on_device(state, d.backward_floor(), [&] { d.backward(); });
}

BENCHMARK_CAPTURE(raster_forward_on_device, centre, SortOrder::centre)->Apply(bench::by_the_clock);
BENCHMARK_CAPTURE(raster_forward_saved_on_device, centre, SortOrder::centre)->Apply(bench::by_the_clock);
BENCHMARK_CAPTURE(raster_backward_on_device, centre, SortOrder::centre)->Apply(bench::by_the_clock);
BENCHMARK_CAPTURE(raster_forward_saved_on_device, hit, SortOrder::hit)->Apply(bench::by_the_clock);
BENCHMARK_CAPTURE(raster_backward_on_device, hit, SortOrder::hit)->Apply(bench::by_the_clock);

}  // namespace
}  // namespace traceflow::raster
