#include <algorithm>
#include <vector>

#include "base/parallel.h"
#include "math/blend.h"
#include "math/rotation.h"
#include "math/spherical_harmonics.h"
#include "math/surfel_hit.h"
#include "ops/trace/trace.h"
#include "ops/trace/trace_usable.h"

// Tests every ray against every surfel. Sorts a ray's hits by distance, then blends them (method §5.2).
namespace traceflow::trace {

namespace {

using Frame = SurfelFrame<double>;

struct Ray {
  Vec3<double> origin, direction;
  double width;
  Vec3<double> unit() const { return glm::normalize(direction); }
};

Ray load_ray(const BasicRays<double>& rays, int64_t r) {
  return {load3<double>(rays.origins.row(r)), load3<double>(rays.directions.row(r)),
          rays.widths.empty() ? 0 : rays.widths[r]};
}
bool can_be_traced(const BasicRays<double>& rays, int64_t r) {
  return is_traceable(rays.origins.row(r), rays.directions.row(r)) &&
         (rays.widths.empty() || is_width(rays.widths[r]));
}

// A Gaussian widened by a cone (method §5.5). Its standard deviations σ become √(σ² + spread²). Its peak
// falls from 1 to Π σ / √(σ² + spread²), so that its integral is unchanged.
struct Widened {
  double spread;       // the cone's width times the distance; scene units
  Vec2<double> scale;  // √(σ² + spread²)
  double u, v;         // in units of `scale`
  double value;        // at the hit
};

Widened widened(const Frame& frame, const SurfelHit<double>& at, const Ray& ray) {
  const double spread = ray.width * at.t * length(ray.direction);
  const Vec2<double> scale = glm::sqrt(frame.scale * frame.scale + spread * spread);
  const double u = at.u * frame.scale.x / scale.x, v = at.v * frame.scale.y / scale.y;
  const double peak = frame.scale.x / scale.x * (frame.scale.y / scale.y);
  return {spread, scale, u, v, peak * std::exp(-0.5 * (u * u + v * v))};
}

struct Hit {
  int64_t surfel;
  SurfelHit<double> at;
  Widened gaussian;
  BlendAlpha<double> alpha;
};

BlendRules<double> rules(const Options& o) { return {o.alpha_min, o.alpha_max, o.transmittance_min}; }

// The result of blending a ray's hits.
struct Blend {
  std::vector<Hit> hits;              // blended hits, front to back
  std::vector<Vec3<double>> colour;   // of each hit
  std::vector<double> transmittance;  // in front of each hit
  double remaining = 1;
  double alpha = 0;
  double distance_sum = 0;
};

std::vector<Frame> make_frames(const BasicPosedSurfels<double>& surfels) {
  std::vector<Frame> frames(static_cast<size_t>(surfels.count()));
  for (int64_t i = 0; i < surfels.count(); ++i) {
    frames[static_cast<size_t>(i)] = {load3<double>(surfels.position.row(i)),
                                      rotation_from_quaternion(load4<double>(surfels.rotation.row(i))),
                                      {surfels.scale(i, 0), surfels.scale(i, 1)}};
  }
  return frames;
}

std::vector<Hit> find_hits(const BasicPosedSurfels<double>& surfels, const std::vector<Frame>& frames,
                           const Ray& ray, const Options& options) {
  std::vector<Hit> hits;
  for (int64_t i = 0; i < surfels.count(); ++i) {
    if (!is_usable(surfels, i, static_cast<double>(options.alpha_min))) continue;
    const SurfelHit<double> at = intersect(frames[static_cast<size_t>(i)], ray.origin, ray.direction);
    if (!at.valid || !(at.t * length(ray.direction) >= options.t_min)) continue;
    const Widened gaussian = widened(frames[static_cast<size_t>(i)], at, ray);
    const BlendAlpha<double> alpha = blend_alpha(rules(options), surfels.opacity[i], gaussian.value);
    if (alpha.value > 0) hits.push_back({i, at, gaussian, alpha});
  }
  std::stable_sort(hits.begin(), hits.end(), [](const Hit& a, const Hit& b) { return a.at.t < b.at.t; });
  return hits;
}

Blend blend(const BasicPosedSurfels<double>& surfels, const std::vector<Frame>& frames, const Ray& ray,
            const Options& options) {
  const int degree = sh_degree(surfels.sh.dim(1));
  Blend result;
  for (const Hit& hit : find_hits(surfels, frames, ray, options)) {
    if (blend_ends(rules(options), result.remaining, hit.alpha.value)) break;
    const double weight = hit.alpha.value * result.remaining;
    result.hits.push_back(hit);
    result.colour.push_back(sh_colour(degree, surfels.sh.row(hit.surfel), ray.unit()));
    result.transmittance.push_back(result.remaining);
    result.alpha += weight;
    result.distance_sum += weight * hit.at.t;
    result.remaining *= 1 - hit.alpha.value;
  }
  return result;
}

// dL/doutput of one ray; zero for an empty tensor.
struct RayGradient {
  Vec3<double> colour{0};
  double alpha = 0, distance = 0;
};

RayGradient load_gradient(const BasicOutputGradient<double>& grad, int64_t ray) {
  RayGradient g;
  if (!grad.colour.empty()) g.colour = load3<double>(grad.colour.row(ray));
  if (!grad.alpha.empty()) g.alpha = grad.alpha[ray];
  if (!grad.distance.empty()) g.distance = grad.distance[ray];
  return g;
}

// dL/dalpha of every hit, back to front, with a running sum over the hits behind.
std::vector<double> alpha_gradients(const Blend& b, const RayGradient& grad, const Vec3<double>& background) {
  const double distance = b.distance_sum / b.alpha;
  std::vector<double> result(b.hits.size());
  double behind = b.remaining * dot(grad.colour, background);
  for (size_t i = b.hits.size(); i-- > 0;) {
    const Hit& hit = b.hits[i];
    const double grad_weight =
        dot(grad.colour, b.colour[i]) + grad.alpha + grad.distance * (hit.at.t - distance) / b.alpha;
    result[i] = blend_alpha_gradient(b.transmittance[i], hit.alpha.value, grad_weight, behind);
    behind += hit.alpha.value * b.transmittance[i] * grad_weight;
  }
  return result;
}

struct HitGradient {
  SurfelHitGradient<double> geometry;
  double opacity = 0, width = 0;
};

// dL/d(u, v, scale and spread) from dL/d(log of the widened Gaussian). u and v are in the surfel's own
// standard deviations.
struct WidenedGradient {
  double u, v, spread;
  Vec2<double> scale;
};

WidenedGradient widened_backward(const Frame& frame, const Widened& g, double grad_log) {
  const Vec2<double> share = frame.scale / g.scale;  // σ / √(σ² + spread²)
  // By the widened standard deviation S of an axis: -1/S from the peak and u²/S from the slope.
  const Vec2<double> by_scale = grad_log * Vec2<double>(g.u * g.u - 1, g.v * g.v - 1) / g.scale;
  WidenedGradient to{};
  to.u = -grad_log * g.u * share.x;
  to.v = -grad_log * g.v * share.y;
  // Here the hit's position in lengths is constant, so σ enters only through the peak and the widened
  // deviation.
  to.scale = grad_log / frame.scale + by_scale * share;
  to.spread = dot(by_scale, g.spread / g.scale);
  return to;
}

HitGradient hit_backward(const Frame& frame, const Ray& ray, const Hit& hit, double opacity,
                         double grad_alpha, double grad_t) {
  const double grad_exponent =
      grad_alpha * hit.alpha.slope * hit.alpha.value;  // alpha = opacity · exp(-(u² + v²) / 2)
  const WidenedGradient g = widened_backward(frame, hit.gaussian, grad_exponent);
  const double length_of_ray = length(ray.direction);
  HitGradient to;
  to.geometry = intersect_backward(frame, ray.origin, ray.direction, hit.at,
                                   grad_t + g.spread * ray.width * length_of_ray, g.u, g.v);
  // intersect_backward() derives the gradient of the scale from u and v. This replaces it by that of the
  // widened Gaussian.
  to.geometry.scale = g.scale;
  to.geometry.direction += g.spread * ray.width * hit.at.t * ray.unit();
  to.opacity = grad_exponent / opacity;
  to.width = g.spread * hit.at.t * length_of_ray;
  return to;
}

void add_surfel(const HitGradient& hit, int64_t i, const Vec4<double>& quaternion,
                BasicPosedSurfels<double>& grad) {
  add3(grad.position.row(i), hit.geometry.position);
  const Vec4<double> rotation = rotation_from_quaternion_backward(quaternion, hit.geometry.rotation);
  for (int k = 0; k < 4; ++k) grad.rotation(i, k) += rotation[k];
  for (int k = 0; k < 2; ++k) grad.scale(i, k) += hit.geometry.scale[k];
  grad.opacity[i] += hit.opacity;
}

// dL/d(direction) from dL/d(unit direction).
Vec3<double> normalise_backward(const Vec3<double>& direction, const Vec3<double>& grad_unit) {
  const Vec3<double> unit = glm::normalize(direction);
  return (grad_unit - unit * dot(unit, grad_unit)) / length(direction);
}

void ray_backward(const BasicPosedSurfels<double>& surfels, const std::vector<Frame>& frames, const Ray& ray,
                  const Options& options, const RayGradient& grad_output, int64_t r,
                  BasicInputGradient<double>& gradient) {
  const int degree = sh_degree(surfels.sh.dim(1));
  const Blend b = blend(surfels, frames, ray, options);
  const std::vector<double> grad_alpha = alpha_gradients(b, grad_output, Vec3<double>(options.background));
  Vec3<double> grad_unit(0);
  for (size_t i = 0; i < b.hits.size(); ++i) {
    const Hit& hit = b.hits[i];
    const double weight = hit.alpha.value * b.transmittance[i];
    const HitGradient g =
        hit_backward(frames[static_cast<size_t>(hit.surfel)], ray, hit, surfels.opacity[hit.surfel],
                     grad_alpha[i], grad_output.distance * weight / b.alpha);
    add_surfel(g, hit.surfel, load4<double>(surfels.rotation.row(hit.surfel)), gradient.surfels);
    add3(gradient.rays.origins.row(r), g.geometry.origin);
    add3(gradient.rays.directions.row(r), g.geometry.direction);
    if (!gradient.rays.widths.empty()) gradient.rays.widths[r] += g.width;
    grad_unit += sh_colour_backward(degree, surfels.sh.row(hit.surfel), ray.unit(),
                                    weight * grad_output.colour, gradient.surfels.sh.row(hit.surfel));
  }
  add3(gradient.rays.directions.row(r), normalise_backward(ray.direction, grad_unit));
}

}  // namespace

void forward_reference(const BasicPosedSurfels<double>& surfels, const BasicRays<double>& rays,
                       const Options& options, BasicOutput<double>& output) {
  output.colour.reset({rays.count(), 3});
  output.alpha.reset({rays.count()});
  output.distance.reset({rays.count()});
  const std::vector<Frame> frames = make_frames(surfels);
  parallel_for("trace reference", rays.count(), [&](int64_t r) {
    const Vec3<double> background(options.background);
    store3(output.colour.row(r), background);
    if (!can_be_traced(rays, r)) return;
    const Blend b = blend(surfels, frames, load_ray(rays, r), options);
    Vec3<double> colour = b.remaining * background;
    for (size_t i = 0; i < b.hits.size(); ++i)
      colour += b.hits[i].alpha.value * b.transmittance[i] * b.colour[i];
    store3(output.colour.row(r), colour);
    output.alpha[r] = b.alpha;
    output.distance[r] = b.hits.empty() ? 0 : b.distance_sum / b.alpha;
  });
}

void backward_reference(const BasicPosedSurfels<double>& surfels, const BasicRays<double>& rays,
                        const Options& options, const BasicOutputGradient<double>& grad_output,
                        BasicInputGradient<double>& gradient) {
  gradient.surfels.reset_like(surfels);
  gradient.rays.origins.reset({rays.count(), 3});
  gradient.rays.directions.reset({rays.count(), 3});
  gradient.rays.widths.reset(rays.widths.shape());
  const std::vector<Frame> frames = make_frames(surfels);
  for (int64_t r = 0; r < rays.count(); ++r) {
    if (!can_be_traced(rays, r)) continue;
    ray_backward(surfels, frames, load_ray(rays, r), options, load_gradient(grad_output, r), r, gradient);
  }
}

}  // namespace traceflow::trace
