#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "math/blend.h"
#include "math/rotation.h"
#include "math/spherical_harmonics.h"
#include "math/surfel_hit.h"
#include "math/surfel_projection.h"
#include "ops/raster/raster.h"

// Reference implementation of method §3: double precision, every pixel against every surfel.
namespace traceflow::raster {
namespace {

using Surfels = BasicPosedSurfels<double>;
using Vector2 = Vec2<double>;
using Vector3 = Vec3<double>;

// The values of a surfel that do not depend on the pixel.
struct Projected {
  bool drawn = false;
  SurfelFrame<double> frame;
  Vector3 normal;  // facing the camera
  double facing;   // +1 or -1: normal = facing · frame.rotation[2]
  Vector3 centre;  // camera axes
  bool has_low_pass;
  Vector2 pixel;      // the projected centre, if has_low_pass
  Vector3 direction;  // unit, from the camera to the centre
  Vector3 colour;
  double opacity, tint, in_body, roughness;
};

// A hit of a pixel's ray with a surfel.
struct Hit {
  int64_t surfel;
  double z;
  bool on_plane;  // false if the low-pass wins
  SurfelHit<double> plane;
  double gaussian;
  BlendAlpha<double> alpha;
};

// A blended hit.
struct Blended {
  Hit hit;
  double transmittance;  // in front of it
  double weight;
  double m;  // its depth in the distortion
};

struct Pixel {
  std::vector<Blended> blended;  // front to back
  double transmittance = 1;      // remaining
  std::optional<size_t> median;
  double depth_sum = 0, m_sum = 0, m2_sum = 0;

  double alpha() const { return 1 - transmittance; }
  double depth() const { return blended.empty() ? 0 : depth_sum / alpha(); }
};

class Scene {
 public:
  Scene(const Surfels& surfels, const Camera<double>& camera, const Options& options)
      : surfels_(surfels), camera_(camera), options_(options) {
    for (int64_t i = 0; i < surfels.count(); ++i) projected_.push_back(project(i));
  }

  const Projected& projected(int64_t i) const { return projected_[static_cast<size_t>(i)]; }
  int sh_degree() const { return traceflow::sh_degree(surfels_.sh.dim(1)); }
  // ρ of the low-pass divided by the squared distance in pixels.
  double rho_per_pixel2() const { return 2 / (double{options_.low_pass} * options_.low_pass); }

  Pixel blend(const Vector2& pixel) const {
    std::vector<Hit> hits;
    for (int64_t i = 0; i < surfels_.count(); ++i) {
      if (const auto hit = hit_at(pixel, i)) hits.push_back(*hit);
    }
    sort(hits);
    Pixel result;
    for (const Hit& hit : hits) {
      if (blend_ends(rules(), result.transmittance, hit.alpha.value)) break;
      add(hit, result);
    }
    return result;
  }

 private:
  BlendRules<double> rules() const {
    return {options_.alpha_min, options_.alpha_max, options_.transmittance_min};
  }

  bool usable(int64_t i) const {
    const auto& s = surfels_;
    return all_finite(s.position.row(i), 3) && all_finite(s.scale.row(i), 2) &&
           all_finite(s.rotation.row(i), 4) && std::isfinite(s.opacity[i]) &&
           all_finite(s.sh.row(i), s.sh.row_size()) && (!s.has_tint() || std::isfinite(s.tint[i])) &&
           (!s.has_roughness() || std::isfinite(s.roughness[i])) && s.scale(i, 0) > 0 && s.scale(i, 1) > 0;
  }

  Projected project(int64_t i) const {
    Projected p;
    if (!usable(i)) return p;
    const auto& s = surfels_;
    p.frame = {load3<double>(s.position.row(i)),
               rotation_from_quaternion(load4<double>(s.rotation.row(i))),
               {s.scale(i, 0), s.scale(i, 1)}};
    const Vector3 from_camera = p.frame.position - camera_.position;
    p.centre = camera_.camera_from_world * from_camera;
    const bool in_front = p.centre.z >= options_.near_plane;
    if (!in_front && options_.sort == SortOrder::centre) return p;
    if (!(length(from_camera) > 0)) return p;
    p.drawn = true;
    p.has_low_pass = options_.low_pass > 0 && in_front;
    if (p.has_low_pass) p.pixel = camera_.project(p.centre);
    p.facing = dot(p.frame.rotation[2], from_camera) > 0 ? -1 : 1;
    p.normal = p.facing * p.frame.rotation[2];
    p.direction = normalize(from_camera);
    p.colour = sh_colour<double>(sh_degree(), s.sh.row(i), p.direction);
    p.opacity = s.opacity[i];
    p.tint = s.has_tint() ? s.tint[i] : 0;
    p.roughness = s.has_roughness() ? s.roughness[i] : 0;
    p.in_body = s.in_body.empty() ? 0 : s.in_body[i];
    return p;
  }

  // Method §3.1 and §3.2. The candidates are the hit in the plane, if it is beyond the near plane, and the
  // projected centre. The one with the smaller ρ wins: the distance in the surfel or the distance on the
  // screen.
  std::optional<Hit> hit_at(const Vector2& pixel, int64_t i) const {
    const Projected& p = projected(i);
    if (!p.drawn) return std::nullopt;
    constexpr double infinity = std::numeric_limits<double>::infinity();
    Hit hit{};
    hit.surfel = i;
    hit.plane = intersect(p.frame, camera_.position, camera_.ray_in_world(pixel.x, pixel.y));
    const bool hits_plane = hit.plane.valid && hit.plane.t >= options_.near_plane;
    const double rho_plane = hits_plane ? hit.plane.u * hit.plane.u + hit.plane.v * hit.plane.v : infinity;
    const Vector2 offset = pixel - p.pixel;
    const double rho_screen = p.has_low_pass ? rho_per_pixel2() * dot(offset, offset) : infinity;
    const double rho = std::min(rho_plane, rho_screen);
    if (!(rho < infinity)) return std::nullopt;
    hit.on_plane = rho_plane <= rho_screen;
    hit.z = hit.on_plane ? hit.plane.t : p.centre.z;
    hit.gaussian = std::exp(-rho / 2);
    hit.alpha = blend_alpha(rules(), p.opacity, hit.gaussian);
    if (hit.alpha.value == 0) return std::nullopt;
    return hit;
  }

  void sort(std::vector<Hit>& hits) const {
    const auto key = [&](const Hit& h) {
      return options_.sort == SortOrder::centre ? projected(h.surfel).centre.z : h.z;
    };
    std::stable_sort(hits.begin(), hits.end(), [&](const Hit& a, const Hit& b) { return key(a) < key(b); });
  }

  void add(const Hit& hit, Pixel& pixel) const {
    const double weight = hit.alpha.value * pixel.transmittance;
    const double m = distortion_depth<double>(options_.near_plane, options_.far_plane, hit.z);
    const double after = pixel.transmittance * (1 - hit.alpha.value);
    if (pixel.transmittance > 0.5 && after <= 0.5) pixel.median = pixel.blended.size();
    pixel.blended.push_back({hit, pixel.transmittance, weight, m});
    pixel.transmittance = after;
    pixel.depth_sum += weight * hit.z;
    pixel.m_sum += weight * m;
    pixel.m2_sum += weight * m * m;
  }

  const Surfels& surfels_;
  const Camera<double>& camera_;
  const Options& options_;
  std::vector<Projected> projected_;
};

void resize(const Surfels& surfels, const Camera<double>& camera, BasicOutput<double>& output) {
  const Shape plane{camera.height, camera.width};
  const Shape vectors{camera.height, camera.width, 3};
  for (auto* tensor :
       {&output.alpha, &output.tint, &output.depth, &output.median_depth, &output.distortion}) {
    tensor->reset(plane);
  }
  output.silhouette.reset(surfels.in_body.empty() ? Shape{0} : plane);
  output.roughness.reset(surfels.has_roughness() ? plane : Shape{0});
  output.colour.reset(vectors);
  output.normal.reset(vectors);
}

void write_pixel(const Scene& scene, const Pixel& pixel, const Options& options, int64_t index,
                 BasicOutput<double>& output) {
  Vector3 colour = pixel.transmittance * Vector3(options.background);
  Vector3 normal(0.0);
  for (const Blended& b : pixel.blended) {
    const Projected& p = scene.projected(b.hit.surfel);
    colour += b.weight * p.colour;
    normal += b.weight * p.normal;
    output.tint[index] += b.weight * p.tint;
    if (!output.silhouette.empty()) output.silhouette[index] += b.weight * p.in_body;
    if (!output.roughness.empty()) output.roughness[index] += b.weight * p.roughness;
    for (const Blended& nearer :
         std::span(pixel.blended.data(), static_cast<size_t>(&b - pixel.blended.data()))) {
      output.distortion[index] += b.weight * nearer.weight * (b.m - nearer.m) * (b.m - nearer.m);
    }
  }
  store3(&output.colour[3 * index], colour);
  store3(&output.normal[3 * index], normal);
  output.alpha[index] = pixel.alpha();
  output.depth[index] = pixel.depth();
  output.median_depth[index] = pixel.median ? pixel.blended[*pixel.median].hit.z : 0;
}

// dL/doutput at one pixel. An empty tensor means zero.
struct PixelGradient {
  Vector3 colour{0.0}, normal{0.0};
  double alpha = 0, tint = 0, silhouette = 0, roughness = 0, depth = 0, median_depth = 0, distortion = 0;

  PixelGradient(const BasicOutputGradient<double>& g, int64_t index) {
    if (!g.colour.empty()) colour = load3<double>(&g.colour[3 * index]);
    if (!g.normal.empty()) normal = load3<double>(&g.normal[3 * index]);
    if (!g.alpha.empty()) alpha = g.alpha[index];
    if (!g.tint.empty()) tint = g.tint[index];
    if (!g.silhouette.empty()) silhouette = g.silhouette[index];
    if (!g.roughness.empty()) roughness = g.roughness[index];
    if (!g.depth.empty()) depth = g.depth[index];
    if (!g.median_depth.empty()) median_depth = g.median_depth[index];
    if (!g.distortion.empty()) distortion = g.distortion[index];
  }
};

// dL/d(values of a surfel that do not depend on the pixel).
struct ProjectedGradient {
  SurfelHitGradient<double> frame;
  Vector3 normal{0.0}, colour{0.0}, centre{0.0};
  Vector2 pixel{0.0};
  double opacity = 0, tint = 0, roughness = 0;
};

class Backward {
 public:
  Backward(const Surfels& surfels, const Camera<double>& camera, const Options& options,
           BasicInputGradient<double>& gradient)
      : surfels_(surfels),
        camera_(camera),
        options_(options),
        scene_(surfels, camera, options),
        projected_(static_cast<size_t>(surfels.count())),
        gradient_(gradient) {}

  void add_pixel(const Vector2& position, const PixelGradient& g) {
    const Pixel pixel = scene_.blend(position);
    double behind = 0;  // Σ w · dL/dw over the hits behind
    for (size_t i = pixel.blended.size(); i-- > 0;) {
      const Blended& b = pixel.blended[i];
      const double own = weight_gradient(pixel, b, g);
      const double grad_alpha = blend_alpha_gradient(b.transmittance, b.hit.alpha.value, own, behind);
      behind += b.weight * own;
      double grad_z = depth_gradient(pixel, b, g);
      if (pixel.median == i) grad_z += g.median_depth;
      add_values(b, g);
      add_hit(position, b.hit, grad_alpha * b.hit.alpha.slope, grad_z);
    }
  }

  void finish() {
    for (int64_t i = 0; i < surfels_.count(); ++i) {
      if (scene_.projected(i).drawn) project_surfel_backward(i);
    }
  }

 private:
  double weight_gradient(const Pixel& pixel, const Blended& b, const PixelGradient& g) const {
    const Projected& p = scene_.projected(b.hit.surfel);
    const double from_depth = g.depth * (b.hit.z - pixel.depth()) / pixel.alpha();
    const double from_distortion = b.m * b.m * pixel.alpha() + pixel.m2_sum - 2 * b.m * pixel.m_sum;
    return dot(g.colour, p.colour - Vector3(options_.background)) + dot(g.normal, p.normal) +
           g.tint * p.tint + g.silhouette * p.in_body + g.roughness * p.roughness + g.alpha + from_depth +
           g.distortion * from_distortion;
  }

  double depth_gradient(const Pixel& pixel, const Blended& b, const PixelGradient& g) const {
    const double slope = distortion_depth_slope<double>(options_.near_plane, options_.far_plane, b.hit.z);
    return g.depth * b.weight / pixel.alpha() +
           g.distortion * 2 * b.weight * (b.m * pixel.alpha() - pixel.m_sum) * slope;
  }

  void add_values(const Blended& b, const PixelGradient& g) {
    ProjectedGradient& to = projected_[static_cast<size_t>(b.hit.surfel)];
    to.colour += b.weight * g.colour;
    to.normal += b.weight * g.normal;
    to.tint += b.weight * g.tint;
    to.roughness += b.weight * g.roughness;
  }

  // Propagates dL/d(o·G) and dL/dz of one hit.
  void add_hit(const Vector2& position, const Hit& hit, double grad_raw, double grad_z) {
    const Projected& p = scene_.projected(hit.surfel);
    ProjectedGradient& to = projected_[static_cast<size_t>(hit.surfel)];
    to.opacity += grad_raw * hit.gaussian;
    const double grad_rho = -grad_raw * p.opacity * hit.gaussian / 2;
    if (!hit.on_plane) {
      to.pixel += grad_rho * -2 * scene_.rho_per_pixel2() * (position - p.pixel);
      to.centre.z += grad_z;
      return;
    }
    const auto g =
        intersect_backward(p.frame, camera_.position, camera_.ray_in_world(position.x, position.y), hit.plane,
                           grad_z, grad_rho * 2 * hit.plane.u, grad_rho * 2 * hit.plane.v);
    to.frame.position += g.position;
    to.frame.rotation += g.rotation;
    to.frame.scale += g.scale;
    gradient_.camera.position += g.origin;
    // direction = ray · camera_from_world, with ray as a row vector
    gradient_.camera.camera_from_world +=
        outerProduct(camera_.ray_in_camera(position.x, position.y), g.direction);
  }

  void project_surfel_backward(int64_t i) {
    const Projected& p = scene_.projected(i);
    ProjectedGradient& g = projected_[static_cast<size_t>(i)];
    const Vector3 from_camera = p.frame.position - camera_.position;
    if (p.has_low_pass) g.centre += project_backward(camera_, p.centre, g.pixel);
    const Vector3 grad_direction = sh_colour_backward(scene_.sh_degree(), surfels_.sh.row(i), p.direction,
                                                      g.colour, gradient_.surfels.sh.row(i));
    Vector3 grad_from_camera = g.centre * camera_.camera_from_world;
    grad_from_camera +=
        (grad_direction - dot(grad_direction, p.direction) * p.direction) / length(from_camera);
    gradient_.camera.camera_from_world += outerProduct(g.centre, from_camera);
    gradient_.camera.position -= grad_from_camera;

    auto& to = gradient_.surfels;
    store3(to.position.row(i), g.frame.position + grad_from_camera);
    to.scale(i, 0) = g.frame.scale.x;
    to.scale(i, 1) = g.frame.scale.y;
    g.frame.rotation[2] += p.facing * g.normal;
    const auto grad_rotation =
        rotation_from_quaternion_backward(load4<double>(surfels_.rotation.row(i)), g.frame.rotation);
    for (int k = 0; k < 4; ++k) to.rotation(i, k) = grad_rotation[k];
    to.opacity[i] = g.opacity;
    if (surfels_.has_tint()) to.tint[i] = g.tint;
    if (surfels_.has_roughness()) to.roughness[i] = g.roughness;
  }

  const Surfels& surfels_;
  const Camera<double>& camera_;
  const Options& options_;
  Scene scene_;
  std::vector<ProjectedGradient> projected_;
  BasicInputGradient<double>& gradient_;
};

template <class F>
void for_each_pixel(const Camera<double>& camera, F&& f) {
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) f(Vector2(x + 0.5, y + 0.5), int64_t{y} * camera.width + x);
  }
}

}  // namespace

void forward_reference(const BasicPosedSurfels<double>& surfels, const Camera<double>& camera,
                       const Options& options, BasicOutput<double>& output) {
  options.validate();
  resize(surfels, camera, output);
  const Scene scene(surfels, camera, options);
  for_each_pixel(camera, [&](const Vector2& position, int64_t index) {
    write_pixel(scene, scene.blend(position), options, index, output);
  });
}

void backward_reference(const BasicPosedSurfels<double>& surfels, const Camera<double>& camera,
                        const Options& options, const BasicOutputGradient<double>& grad_output,
                        BasicInputGradient<double>& gradient) {
  options.validate();
  gradient.surfels.reset_like(surfels);
  gradient.camera = {};
  gradient.screen_gradient = {};
  Backward backward(surfels, camera, options, gradient);
  for_each_pixel(camera, [&](const Vector2& position, int64_t index) {
    backward.add_pixel(position, PixelGradient(grad_output, index));
  });
  backward.finish();
}

}  // namespace traceflow::raster
