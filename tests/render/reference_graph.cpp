#include "render/reference_graph.h"

#include <algorithm>
#include <numeric>

#include "ops/deform/deform.h"
#include "ops/environment_map/environment_map.h"
#include "ops/raster/raster.h"
#include "ops/shade/shade.h"
#include "ops/surface/surface.h"
#include "ops/trace/trace.h"

namespace traceflow::reference {

namespace {

std::vector<int32_t> all_pixels(const Camera<double>& camera) {
  std::vector<int32_t> pixels(static_cast<size_t>(camera.width * camera.height));
  std::iota(pixels.begin(), pixels.end(), 0);
  return pixels;
}

Camera<double> camera_of_samples(Camera<double> camera, int n) {
  camera.width *= n;
  camera.height *= n;
  camera.focal_x *= n;
  camera.focal_y *= n;
  camera.centre_x *= n;
  camera.centre_y *= n;
  return camera;
}

// The sums of weight · layer over the n×n samples of each pixel of an H×W(×C) picture; without weights, of
// the layer alone.
Tensor<double> sum_of_samples(const Tensor<double>& layer, const Tensor<double>* weight, int n) {
  const bool has_channels = layer.shape().rank() == 3;
  const int64_t h = layer.dim(0) / n, w = layer.dim(1) / n, channels = has_channels ? layer.dim(2) : 1;
  Tensor<double> sums(has_channels ? Shape{h, w, channels} : Shape{h, w});
  for (int64_t y = 0; y < h * n; ++y) {
    for (int64_t x = 0; x < w * n; ++x) {
      const int64_t sample = y * w * n + x, pixel = y / n * w + x / n;
      for (int64_t c = 0; c < channels; ++c)
        sums[pixel * channels + c] += layer[sample * channels + c] * (weight ? (*weight)[sample] : 1.0);
    }
  }
  return sums;
}

// Each sample's share of its pixel's number: number / divisor of the pixel, times the sample's weight.
Tensor<double> shared_among_samples(const Tensor<double>& numbers, const Tensor<double>* divisor,
                                    const Tensor<double>* weight, int n) {
  const bool has_channels = numbers.shape().rank() == 3;
  const int64_t h = numbers.dim(0), w = numbers.dim(1), channels = has_channels ? numbers.dim(2) : 1;
  Tensor<double> shares(has_channels ? Shape{h * n, w * n, channels} : Shape{h * n, w * n});
  for (int64_t y = 0; y < h * n; ++y) {
    for (int64_t x = 0; x < w * n; ++x) {
      const int64_t sample = y * w * n + x, pixel = y / n * w + x / n;
      const double by = (weight ? (*weight)[sample] : 1.0) / (divisor ? (*divisor)[pixel] : n * n);
      for (int64_t c = 0; c < channels; ++c)
        shares[sample * channels + c] = numbers[pixel * channels + c] * by;
    }
  }
  return shares;
}

// One evaluation: every intermediate value, then the way back.
class Graph {
 public:
  Graph(const Parameters& parameters, const Setting& setting) : p_(parameters), s_(setting) {}

  double forward() {
    deform::forward_reference(p_.main, s_.deform ? &p_.main_field : nullptr, s_.main_points, s_.time,
                              s_.sh_degree, main_);
    draw();
    surface::pseudo_normals(p_.camera, raster_.depth, raster_.median_depth, raster_.alpha, s_.depth_ratio,
                            pseudo_);
    specular_.reset({0, 3});
    if (s_.specular) forward_specular();
    Tensor<double> shaded;
    shade::forward(sampled_.colour, sampled_.tint, tensor_of(pixels_), specular_, shaded);
    colour_ = mean(shaded);
    return losses();
  }

  void backward(Gradient& g) {
    g.main = zeros_like<double>(p_.main);
    g.main_field = zeros_like<double>(p_.main_field);
    g.environment = zeros_like<double>(p_.environment);
    g.environment_field = zeros_like<double>(p_.environment_field);
    g.camera = {};
    grad_.median_depth.reset(raster_.depth.shape());
    surface::pseudo_normals_backward(p_.camera, raster_.depth, raster_.median_depth, raster_.alpha,
                                     s_.depth_ratio, grad_pseudo_, grad_.depth, grad_.median_depth,
                                     &g.camera);
    grad_sampled_ = gradient_of_samples();
    grad_sampled_.tint.reset(sampled_.tint.shape());
    const std::vector<float> weights(pixels_.size(), 1.0F);
    Tensor<double> grad_specular;
    shade::backward(sampled_.colour, sampled_.tint, tensor_of(pixels_), tensor_of(weights), specular_,
                    shared_among_samples(grad_colour_, nullptr, nullptr, s_.samples), grad_sampled_.colour,
                    grad_sampled_.tint, grad_specular);
    if (s_.specular) backward_specular(grad_specular, g);
    raster::BasicInputGradient<double> input;
    raster::backward_reference(main_, camera_of_samples(p_.camera, s_.samples), s_.raster, grad_sampled_,
                               input);
    g.camera.camera_from_world += input.camera.camera_from_world;
    g.camera.position += input.camera.position;
    deform::backward_reference(p_.main, s_.deform ? &p_.main_field : nullptr, s_.main_points, s_.time,
                               input.surfels, g.main, s_.deform ? &g.main_field : nullptr);
  }

  void reflect() {
    const Camera<double> camera = camera_of_samples(p_.camera, s_.samples);
    pixels_ = all_pixels(camera);
    surface::reflection_rays(camera, tensor_of(pixels_), sampled_.depth, sampled_.median_depth,
                             sampled_.normal, s_.depth_ratio, rays_.origins, rays_.directions);
    if (!main_.has_roughness()) return;
    rays_.widths = sampled_.roughness;
    for (int64_t i = 0; i < rays_.count(); ++i) rays_.widths[i] /= sampled_.alpha[i];
  }
  const Tensor<double>& directions() const { return rays_.directions; }

 private:
  Tensor<double> mean(const Tensor<double>& layer) const {
    Tensor<double> sums = sum_of_samples(layer, nullptr, s_.samples);
    for (double& v : sums.values()) v /= s_.samples * s_.samples;
    return sums;
  }

  void draw() {
    const int n = s_.samples;
    raster::forward_reference(main_, camera_of_samples(p_.camera, n), s_.raster, sampled_);
    raster_.colour = mean(sampled_.colour);
    raster_.alpha = mean(sampled_.alpha);
    raster_.tint = mean(sampled_.tint);
    raster_.normal = mean(sampled_.normal);
    raster_.distortion = mean(sampled_.distortion);
    weights_ = sum_of_samples(sampled_.alpha, nullptr, n);
    raster_.depth = sum_of_samples(sampled_.depth, &sampled_.alpha, n);
    for (int64_t i = 0; i < raster_.depth.size(); ++i) raster_.depth[i] /= std::max(weights_[i], 1e-300);
    has_median_ = sampled_.median_depth;
    for (double& v : has_median_.values()) v = v > 0 ? 1 : 0;
    medians_ = sum_of_samples(has_median_, nullptr, n);
    for (double& v : medians_.values()) v = std::max(v, 1.0);
    raster_.median_depth = sum_of_samples(sampled_.median_depth, nullptr, n);
    for (int64_t i = 0; i < medians_.size(); ++i) raster_.median_depth[i] /= medians_[i];
  }

  // Of the picture's layers, without colour and tint.
  raster::BasicOutputGradient<double> gradient_of_samples() const {
    const int n = s_.samples;
    raster::BasicOutputGradient<double> g;
    g.normal = shared_among_samples(grad_.normal, nullptr, nullptr, n);
    g.distortion = shared_among_samples(grad_.distortion, nullptr, nullptr, n);
    g.depth = shared_among_samples(grad_.depth, &weights_, &sampled_.alpha, n);
    g.median_depth = shared_among_samples(grad_.median_depth, &medians_, &has_median_, n);
    // The mean depth changes with a sample's alpha by (its depth − the mean) / Σ alpha.
    Tensor<double> by_mean = grad_.depth;
    for (int64_t i = 0; i < by_mean.size(); ++i) by_mean[i] *= -raster_.depth[i];
    const Tensor<double> own = shared_among_samples(grad_.depth, &weights_, &sampled_.depth, n);
    g.alpha = shared_among_samples(by_mean, &weights_, nullptr, n);
    const Tensor<double> direct = shared_among_samples(grad_.alpha, nullptr, nullptr, n);
    for (int64_t i = 0; i < own.size(); ++i) g.alpha[i] += own[i] + direct[i];
    return g;
  }

  void forward_specular() {
    reflect();
    if (p_.map && p_.map->field) {
      moved_ = rays_.directions;
      if (s_.deform) {
        Tensor<double> residuals;
        field::forward_reference(*p_.map->field, s_.map_directions, s_.time, residuals);
        for (int64_t i = 0; i < moved_.size(); ++i) moved_[i] += residuals[i];
      }
      environment_map::forward(p_.map->logit, moved_, specular_);
      return;
    }
    deform::forward_reference(p_.environment, s_.deform ? &p_.environment_field : nullptr,
                              s_.environment_points, s_.time, s_.sh_degree, environment_);
    trace::forward_reference(environment_, rays_, s_.trace, trace_);
    specular_ = trace_.colour;
    if (!p_.map) return;
    moved_ = rays_.directions;
    environment_map::forward(p_.map->logit, moved_, behind_);
    for (int64_t i = 0; i < specular_.size(); ++i) specular_[i] += (1 - trace_.alpha[i / 3]) * behind_[i];
  }

  void backward_specular(const Tensor<double>& grad_specular, Gradient& g) {
    trace::BasicInputGradient<double> input;
    if (p_.map) g.map.logit.reset(p_.map->logit.shape());
    if (p_.map && p_.map->field) {
      g.map.field = zeros_like<double>(*p_.map->field);
      input.rays.origins.reset(rays_.origins.shape());
      input.rays.directions.reset(rays_.directions.shape());
      environment_map::backward(p_.map->logit, moved_, grad_specular, g.map.logit, input.rays.directions);
      if (s_.deform) {
        field::backward_reference(*p_.map->field, s_.map_directions, s_.time, input.rays.directions,
                                  *g.map.field);
      }
    } else {
      trace::BasicOutputGradient<double> grad_trace;
      grad_trace.colour = grad_specular;
      Tensor<double> by_behind;
      if (p_.map) {
        grad_trace.alpha.reset(trace_.alpha.shape());
        Tensor<double> grad_behind(behind_.shape());
        for (int64_t i = 0; i < behind_.size(); ++i) {
          grad_behind[i] = (1 - trace_.alpha[i / 3]) * grad_specular[i];
          grad_trace.alpha[i / 3] -= grad_specular[i] * behind_[i];
        }
        by_behind.reset(rays_.directions.shape());
        environment_map::backward(p_.map->logit, moved_, grad_behind, g.map.logit, by_behind);
      }
      trace::backward_reference(environment_, rays_, s_.trace, grad_trace, input);
      deform::backward_reference(p_.environment, s_.deform ? &p_.environment_field : nullptr,
                                 s_.environment_points, s_.time, input.surfels, g.environment,
                                 s_.deform ? &g.environment_field : nullptr);
      for (int64_t i = 0; i < by_behind.size(); ++i) input.rays.directions[i] += by_behind[i];
    }
    if (!input.rays.widths.empty()) {
      grad_sampled_.roughness.reset(sampled_.alpha.shape());
      for (int64_t i = 0; i < rays_.count(); ++i) {
        const double by_width = input.rays.widths[i] / sampled_.alpha[i];
        grad_sampled_.roughness[i] = by_width;
        grad_sampled_.alpha[i] -= by_width * rays_.widths[i];
      }
    }
    surface::reflection_rays_backward(camera_of_samples(p_.camera, s_.samples), tensor_of(pixels_),
                                      sampled_.depth, sampled_.median_depth, sampled_.normal, s_.depth_ratio,
                                      input.rays.origins, input.rays.directions, grad_sampled_.depth,
                                      grad_sampled_.median_depth, grad_sampled_.normal, &g.camera);
  }

  double losses() {
    grad_colour_.reset(colour_.shape());
    grad_.normal.reset(raster_.normal.shape());
    grad_.alpha.reset(raster_.alpha.shape());
    grad_pseudo_.reset(raster_.normal.shape());
    const Weights& w = s_.weights;
    double total = w.l1 * loss::l1_reference(colour_, s_.target, w.l1, grad_colour_);
    total += w.ssim * loss::ssim_loss_reference(colour_, s_.target, w.ssim, grad_colour_);
    total += w.normal * loss::normal_consistency_reference(raster_.normal, raster_.alpha, pseudo_, w.normal,
                                                           grad_.normal, grad_.alpha, grad_pseudo_);
    total += w.normal_prior *
             loss::normal_prior_reference(raster_.normal, s_.prior, {}, 1, w.normal_prior, grad_.normal);
    grad_.depth.reset(raster_.depth.shape());
    total += w.depth_prior *
             loss::depth_prior_reference(raster_.depth, s_.depth_prior, w.depth_prior, grad_.depth);
    const auto pixels = static_cast<double>(raster_.distortion.size());
    grad_.distortion.reset(raster_.distortion.shape());
    grad_.distortion.fill(w.distortion / pixels);
    double distortion = 0;
    for (const double d : raster_.distortion.values()) distortion += d / pixels;
    return total + w.distortion * distortion;
  }

  const Parameters& p_;
  const Setting& s_;
  BasicPosedSurfels<double> main_, environment_;
  raster::BasicOutput<double> sampled_, raster_;
  Tensor<double> weights_, medians_, has_median_;
  trace::BasicOutput<double> trace_;
  std::vector<int32_t> pixels_;
  trace::BasicRays<double> rays_;
  Tensor<double> pseudo_, moved_, behind_, specular_, colour_;
  Tensor<double> grad_colour_, grad_pseudo_;
  raster::BasicOutputGradient<double> grad_, grad_sampled_;
};

}  // namespace

double loss(const Parameters& parameters, const Setting& setting, Gradient* gradient) {
  Graph graph(parameters, setting);
  const double value = graph.forward();
  if (gradient) graph.backward(*gradient);
  return value;
}

Tensor<double> reflection_directions(const Parameters& parameters, const Setting& setting) {
  Setting still = setting;
  still.specular = false;
  Graph graph(parameters, still);
  graph.forward();
  graph.reflect();
  return graph.directions();
}

}  // namespace traceflow::reference
