#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "math/rotation.h"
#include "math/spherical_harmonics.h"
#include "math/surfel_projection.h"
#include "ops/raster/raster_kernels.h"

// From the sums over pixels to the surfels' values and the camera's pose: prepare() in reverse.
namespace traceflow::raster {
namespace {

constexpr int64_t surfels_per_block = 256;

class Chain {
 public:
  Chain(const PosedSurfels& surfels, const Camera<float>& camera, const Saved& saved, InputGradient& gradient)
      : surfels_(surfels),
        camera_(convert<double>(camera)),
        saved_(saved),
        gradient_(gradient),
        sh_degree_(surfels.count() > 0 ? sh_degree(surfels.sh.dim(1)) : 0) {}

  void run(int64_t i, CameraGradient<double>& camera) {
    prefetch(i + surfel_prefetch_distance);
    clear(i);
    SplatGradient sums{};
    if (add_tiles(i, sums)) chain(i, sums, camera);
  }

 private:
  void prefetch(int64_t i) const {
    if (i >= saved_.count || saved_.entry_begin[i] == saved_.entry_begin[i + 1]) return;
    prefetch_row(surfels_.position, i);
    prefetch_row(surfels_.scale, i);
    prefetch_row(surfels_.rotation, i);
    prefetch_row(surfels_.sh, i);
    prefetch_row(saved_.splats, i);
    prefetch_row(saved_.scratch.gradients, saved_.entry_begin[i]);
    prefetch_row(saved_.touched, saved_.entry_begin[i]);
  }

  void clear(int64_t i) {
    auto& g = gradient_.surfels;
    const auto zero = [i](Tensor<float>& t) { std::fill_n(t.row(i), t.row_size(), 0.0F); };
    zero(g.position);
    zero(g.scale);
    zero(g.rotation);
    zero(g.sh);
    g.opacity[i] = 0;
    if (surfels_.has_tint()) g.tint[i] = 0;
    gradient_.screen_gradient[i] = 0;
  }

  // Adds the tiles that blended the surfel, in their order; false if there are none.
  bool add_tiles(int64_t i, SplatGradient& sums) const {
    bool any = false;
    for (uint32_t entry = saved_.entry_begin[i]; entry < saved_.entry_begin[i + 1]; ++entry) {
      if (saved_.touched[entry] == 0) continue;
      any = true;
      const float* const from = &saved_.scratch.gradients[entry].u_x;
      float* const to = &sums.u_x;
      for (size_t k = 0; k < sizeof(SplatGradient) / sizeof(float); ++k) to[k] += from[k];
    }
    return any;
  }

  void chain(int64_t i, const SplatGradient& sums, CameraGradient<double>& camera) {
    const SurfelFrame<double> frame = surfel_frame(surfels_, i);
    const Vec3<double> from_camera = frame.position - camera_.position;
    const Vec3<double> centre = camera_.camera_from_world * from_camera;
    const SurfelForms<double> forms = surfel_forms(frame, camera_);
    SurfelFormsGradient<double> g = surfel_forms_backward(frame, camera_, forms, forms_gradient(i, sums));

    Vec3<double> grad_centre(0, 0, sums.z_centre);
    if (saved_.splats[i].rho_screen_1 == 0) {
      grad_centre += project_backward(camera_, centre, Vec2<double>(2 * sums.centre_x, 2 * sums.centre_y));
    }
    g.from_camera += grad_centre * camera_.camera_from_world;
    g.camera_from_world += outerProduct(grad_centre, from_camera);
    gradient_.screen_gradient[i] = screen_gradient(g.from_camera, centre.z);
    g.from_camera += colour_gradient(i, from_camera, sums);
    g.rotation[2] += (dot(frame.rotation[2], from_camera) > 0 ? -1.0 : 1.0) * load3<double>(sums.normal);

    auto& to = gradient_.surfels;
    store3(to.position.row(i), g.from_camera);
    for (int a = 0; a < 2; ++a) to.scale(i, a) = static_cast<float>(g.scale[a]);
    const auto q = rotation_from_quaternion_backward(load4<double>(surfels_.rotation.row(i)), g.rotation);
    for (int a = 0; a < 4; ++a) to.rotation(i, a) = static_cast<float>(q[a]);
    to.opacity[i] = sums.log_opacity / surfels_.opacity[i];
    if (surfels_.has_tint()) to.tint[i] = sums.tint;
    camera.camera_from_world += g.camera_from_world;
    camera.position -= g.from_camera;
  }

  // The sums are over pixels relative to the splat's anchor.
  SurfelForms<double> forms_gradient(int64_t i, const SplatGradient& sums) const {
    const Splat& splat = saved_.splats[i];
    const Vec3<double> ray = camera_.ray_in_camera(splat.anchor_x, splat.anchor_y);
    const auto form = [&](double x, double y, double one) {
      return one * ray + Vec3<double>(x / camera_.focal_x, y / camera_.focal_y, 0);
    };
    return {form(sums.u_x, sums.u_y, sums.u_1), form(sums.v_x, sums.v_y, sums.v_1),
            form(sums.w_x, sums.w_y, sums.w_1), sums.z_plane, 0};
  }

  // Moving the projected centre by one pixel at constant depth moves the surfel by z/focal.
  float screen_gradient(const Vec3<double>& grad_position, double z) const {
    const Vec3<double> g = camera_.camera_from_world * grad_position;
    const double x = g.x * z / camera_.focal_x * camera_.width / 2;
    const double y = g.y * z / camera_.focal_y * camera_.height / 2;
    return static_cast<float>(std::sqrt(x * x + y * y));
  }

  // Fills the gradient of the harmonics and returns that of the vector from the camera to the surfel.
  Vec3<double> colour_gradient(int64_t i, const Vec3<double>& from_camera, const SplatGradient& sums) {
    const double distance = length(from_camera);
    const Vec3<double> direction = from_camera / distance;
    const Vec3<double> grad(sh_colour_backward<float>(sh_degree_, surfels_.sh.row(i), Vec3<float>(direction),
                                                      load3<float>(sums.colour),
                                                      gradient_.surfels.sh.row(i)));
    return (grad - dot(grad, direction) * direction) / distance;
  }

  const PosedSurfels& surfels_;
  const Camera<double> camera_;
  const Saved& saved_;
  InputGradient& gradient_;
  const int sh_degree_;
};

}  // namespace

void chain(const PosedSurfels& surfels, const Camera<float>& camera, const Saved& saved,
           InputGradient& gradient) {
  const int64_t n = surfels.count();
  auto& g = gradient.surfels;
  g.position.resize(surfels.position.shape());
  g.scale.resize(surfels.scale.shape());
  g.rotation.resize(surfels.rotation.shape());
  g.opacity.resize(surfels.opacity.shape());
  g.sh.resize(surfels.sh.shape());
  g.tint.resize(surfels.tint.shape());
  gradient.screen_gradient.resize({n});

  Chain chain(surfels, camera, saved, gradient);
  std::vector<CameraGradient<double>> partial(
      static_cast<size_t>((n + surfels_per_block - 1) / surfels_per_block));
  parallel_blocks("raster: chain", n, surfels_per_block, [&](int64_t begin, int64_t end) {
    auto& camera_gradient = partial[static_cast<size_t>(begin / surfels_per_block)];
    for (int64_t i = begin; i < end; ++i) chain.run(i, camera_gradient);
  });
  CameraGradient<double> total;
  for (const auto& p : partial) {
    total.camera_from_world += p.camera_from_world;
    total.position += p.position;
  }
  if (!gradient.wants_camera) total = {};
  gradient.camera = {Mat3<float>(total.camera_from_world), Vec3<float>(total.position)};
}

}  // namespace traceflow::raster
