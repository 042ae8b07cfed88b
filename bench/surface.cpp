#include "ops/surface/surface.h"

#include <string_view>

#include "on_device.h"
#include "ops/shade/shade.h"

// From depth to reflected rays, and the blend of both images, on the CUDA device: a frame that is covered by
// surfaces, all of which reflect.
namespace traceflow {
namespace {

class OnDevice {
 public:
  OnDevice() {
    camera_.width = bench::frame_width;
    camera_.height = bench::frame_height;
    camera_.focal_x = camera_.focal_y = 400;
    camera_.centre_x = 0.5F * bench::frame_width;
    camera_.centre_y = 0.5F * bench::frame_height;
    surface::pseudo_normals(camera_, depth_, median_, alpha_, depth_ratio, pseudo_);
    select();
    reflect();
    specular_ = bench::noise_on_device(directions_.shape(), 0, 1, 8);
    grad_rays_ = bench::noise_on_device(directions_.shape(), -1, 1, 9);
    shade();
  }

  void pseudo_normals() { surface::pseudo_normals(camera_, depth_, median_, alpha_, depth_ratio, pseudo_); }
  void pseudo_normals_backward(bool wants_pose) {
    surface::pseudo_normals_backward(camera_, depth_, median_, alpha_, depth_ratio, vectors_, grad_depth_,
                                     grad_median_, wants_pose ? &grad_camera_ : nullptr);
  }
  void select() { surface::select_pixels(alpha_, tint_, normal_, {}, true, 1, traced_); }
  void reflect() {
    surface::reflection_rays(camera_, traced_.pixel, depth_, median_, normal_, depth_ratio, origins_,
                             directions_);
  }
  void reflect_backward(bool wants_pose) {
    surface::reflection_rays_backward(camera_, traced_.pixel, depth_, median_, normal_, depth_ratio,
                                      grad_rays_, grad_rays_, grad_depth_, grad_median_, grad_normal_,
                                      wants_pose ? &grad_camera_ : nullptr);
  }
  void shade() { shade::forward(vectors_, tint_, traced_.pixel, specular_, colour_); }
  void shade_backward() {
    shade::backward(vectors_, tint_, traced_.pixel, traced_.weight, specular_, colour_, grad_diffuse_,
                    grad_tint_, grad_specular_);
  }

  // With a depth ratio of 0 the median's depth need not be read.
  bench::Floor pseudo_normals_floor() const { return {bench::bytes(depth_, alpha_, pseudo_), 60 * pixels()}; }
  bench::Floor pseudo_normals_backward_floor() const {
    return {bench::bytes(depth_, alpha_, vectors_) + 2 * bench::bytes(grad_depth_), 150 * pixels()};
  }
  bench::Floor select_floor() const {
    return {bench::bytes(alpha_, tint_, normal_, traced_.pixel, traced_.weight), 20 * pixels()};
  }
  bench::Floor reflect_floor() const {
    return {bench::bytes(traced_.pixel, depth_, normal_, origins_, directions_), 60 * pixels()};
  }
  bench::Floor reflect_backward_floor() const {
    return {bench::bytes(traced_.pixel, depth_, normal_) + 2 * bench::bytes(grad_rays_) +
                2 * bench::bytes(grad_depth_, grad_normal_),
            150 * pixels()};
  }
  bench::Floor shade_floor() const {
    return {bench::bytes(vectors_, tint_, traced_.pixel, specular_, colour_), 9 * pixels()};
  }
  bench::Floor shade_backward_floor() const {
    return {bench::bytes(vectors_, tint_, traced_.pixel, traced_.weight, specular_, colour_) +
                bench::bytes(grad_diffuse_, grad_specular_) + 2 * bench::bytes(grad_tint_),
            20 * pixels()};
  }

 private:
  static constexpr float depth_ratio = 0;
  static double pixels() { return static_cast<double>(bench::frame_pixels); }

  const Shape plane_{bench::frame_height, bench::frame_width};
  const Shape vector_{bench::frame_height, bench::frame_width, 3};
  Camera<float> camera_;
  Tensor<float> depth_ = bench::noise_on_device(plane_, 2, 2.1, 1),
                median_ = bench::noise_on_device(plane_, 2, 2.1, 2),
                alpha_ = bench::noise_on_device(plane_, 0.5, 1, 3),
                tint_ = bench::noise_on_device(plane_, 0.1, 1, 4),
                normal_ = bench::noise_on_device(vector_, -1, 0, 5),
                vectors_ = bench::noise_on_device(vector_, 0, 1, 6);
  Tensor<float> pseudo_, origins_, directions_, specular_, colour_;
  surface::TracedPixels traced_;
  Tensor<float> grad_rays_, grad_diffuse_, grad_specular_;
  Tensor<float> grad_depth_{plane_, Device::cuda}, grad_median_{plane_, Device::cuda},
      grad_tint_{plane_, Device::cuda}, grad_normal_{vector_, Device::cuda};
  CameraGradient<float> grad_camera_;
};

void pseudo_normals_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d;
  bench::time_on_device(state, d.pseudo_normals_floor(), [&] { d.pseudo_normals(); });
}
BENCHMARK(pseudo_normals_on_device)->Apply(bench::by_the_clock);

// With the pose's gradient, for which the host waits, and without.
void pseudo_normals_backward_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d;
  bench::time_on_device(state, d.pseudo_normals_backward_floor(),
                        [&] { d.pseudo_normals_backward(state.range(0) != 0); });
}
BENCHMARK(pseudo_normals_backward_on_device)->Apply(bench::by_the_clock)->ArgName("pose")->Arg(0)->Arg(1);

void select_pixels_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d;
  bench::time_on_device(state, d.select_floor(), [&] { d.select(); });
}
BENCHMARK(select_pixels_on_device)->Apply(bench::by_the_clock);

void reflection_rays_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d;
  bench::time_on_device(state, d.reflect_floor(), [&] { d.reflect(); });
}
BENCHMARK(reflection_rays_on_device)->Apply(bench::by_the_clock);

void reflection_rays_backward_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d;
  bench::time_on_device(state, d.reflect_backward_floor(), [&] { d.reflect_backward(state.range(0) != 0); });
}
BENCHMARK(reflection_rays_backward_on_device)->Apply(bench::by_the_clock)->ArgName("pose")->Arg(0)->Arg(1);

void shade_forward_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d;
  bench::time_on_device(state, d.shade_floor(), [&] { d.shade(); });
}
BENCHMARK(shade_forward_on_device)->Apply(bench::by_the_clock);

void shade_backward_on_device(benchmark::State& state) {
  if (bench::no_device(state)) return;
  OnDevice d;
  bench::time_on_device(state, d.shade_backward_floor(), [&] { d.shade_backward(); });
}
BENCHMARK(shade_backward_on_device)->Apply(bench::by_the_clock);

}  // namespace
}  // namespace traceflow
