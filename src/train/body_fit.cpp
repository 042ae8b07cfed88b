#include "train/body_fit.h"

#include <algorithm>
#include <cmath>

#include "track/prior_bias.h"

namespace traceflow {

namespace {

// At most 20, spread evenly over the video, in the order of time.
std::vector<const View*> some_views(const Capture& capture) {
  constexpr size_t most_views = 20;
  std::vector<const View*> all;
  for (const View& view : capture.train) all.push_back(&view);
  std::stable_sort(all.begin(), all.end(), [](const View* a, const View* b) { return a->time < b->time; });
  const size_t step = (all.size() + most_views - 1) / most_views;
  std::vector<const View*> some;
  for (size_t k = 0; k < all.size(); k += step) some.push_back(all[k]);
  return some;
}

FrameRequest request_for(const View& view) {
  FrameRequest request;
  request.camera = view.camera;
  request.time = view.time;
  request.deform_main = request.specular = false;
  return request;
}

}  // namespace

std::vector<double> silhouette_errors(const Capture& capture, const Scene& scene, Renderer& renderer) {
  std::vector<double> errors;
  for (const View* view : some_views(capture)) {
    const std::shared_ptr<const ViewImages> images = load_images(capture, *view);
    if (images->coverage.empty()) continue;
    FrameRequest request = request_for(*view);
    request.silhouette = true;
    const Tensor<float> silhouette = renderer.forward(scene, request).raster.silhouette.on(Device::cpu);
    double error = 0, area = 0;
    for (int64_t i = 0; i < images->coverage.size(); ++i) {
      error += std::abs(silhouette[i] - images->coverage[i]);
      area += images->coverage[i];
    }
    errors.push_back(area > 0 ? error / area : 0);
  }
  return errors;
}

double relative_colour_error(const Capture& capture, const Motion& at_rest, int sh_degree, Scene& scene,
                             Renderer& renderer) {
  struct Drawn {
    Tensor<float> colour, silhouette;
  };
  const auto draw = [&](const View& view) {
    FrameRequest request = request_for(view);
    request.sh_degree_main = sh_degree;
    request.silhouette = true;
    const Frame& frame = renderer.forward(scene, request);
    return Drawn{frame.colour.on(Device::cpu), frame.raster.silhouette.on(Device::cpu)};
  };
  std::optional<Motion> other = at_rest;
  double error = 0, error_at_rest = 0;
  for (const View* view : some_views(capture)) {
    const Drawn moved = draw(*view);
    std::swap(scene.main_motion, other);
    const Drawn rested = draw(*view);
    std::swap(scene.main_motion, other);
    const std::shared_ptr<const ViewImages> images = load_images(capture, *view);
    for (int64_t i = 0; i < moved.silhouette.size(); ++i) {
      if (!images->known.empty() && images->known[i] == 0) continue;
      const double share = std::max(moved.silhouette[i], rested.silhouette[i]);
      for (int64_t c = 3 * i; c < 3 * i + 3; ++c) {
        error += share * std::abs(moved.colour[c] - images->colour[c]);
        error_at_rest += share * std::abs(rested.colour[c] - images->colour[c]);
      }
    }
  }
  return error_at_rest > 0 ? error / error_at_rest : 1;
}

std::optional<Mat3<double>> measured_prior_bias(const Capture& capture, const Scene& scene,
                                                Renderer& renderer) {
  constexpr float opaque = 0.95F;
  PriorBias in_masks;
  for (const View* view : some_views(capture)) {
    const std::shared_ptr<const ViewImages> images = load_images(capture, *view);
    if (images->mask.empty() || images->normal_prior.empty()) continue;
    FrameRequest request = request_for(*view);
    request.pseudo_normals = true;
    const Frame& frame = renderer.forward(scene, request);
    const Tensor<float> alpha = frame.raster.alpha.on(Device::cpu),
                        normal = frame.pseudo_normal.on(Device::cpu);
    for (int64_t i = 0; i < alpha.size(); ++i) {
      if (images->mask[i] == 0 || alpha[i] < opaque) continue;
      in_masks.add(view->camera, load3<double>(&normal[3 * i]), load3<double>(&images->normal_prior[3 * i]));
    }
  }
  return in_masks.rotation();
}

Unrest measured_unrest(const Capture& capture, const Scene& scene, int sh_degree, Renderer& renderer) {
  constexpr size_t most_views = 40;
  const Surfels main = scene.main.on(Device::cpu);
  Unrest unrest;
  const size_t step = std::max<size_t>(1, capture.train.size() / most_views);
  for (size_t k = 0; k < capture.train.size(); k += step) {
    const View& view = capture.train[k];
    const std::shared_ptr<const ViewImages> images = load_images(capture, view);
    if (images->mask.empty()) continue;
    FrameRequest request = request_for(view);
    request.sh_degree_main = sh_degree;
    const Frame& frame = renderer.forward(scene, request);
    unrest.look(main, view, *images, frame.colour.on(Device::cpu), frame.raster.alpha.on(Device::cpu),
                frame.raster.depth.on(Device::cpu));
  }
  return unrest;
}

}  // namespace traceflow
