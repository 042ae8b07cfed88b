#include "eval/report.h"

#include <algorithm>

#include "base/clock.h"
#include "capture/motion_truth.h"
#include "capture/pixels.h"
#include "eval/carriers.h"
#include "eval/figures_json.h"
#include "eval/surfel_density.h"
#include "scene/viewpoint.h"

namespace traceflow::eval {

Metrics mean_of(const Report& report) {
  std::vector<Metrics> all;
  for (const ViewReport& view : report.views) all.push_back(view.metrics);
  return mean(all);
}

void evaluate(const viz::Subject& subject, const Capture& capture, const std::vector<View>& views,
              const lpips::Network* network, const ViewListener& listener, Report& report) {
  report.main_surfels = subject.scene.main.count();
  report.environment_surfels = subject.scene.environment.count();
  const std::optional<MotionTruth> motion = load_motion_truth(capture);
  // True depths are in the capture's scene units, which may differ from the run's.
  const double z_per_truth = subject.scene.normalisation.scale / capture.normalisation.scale;
  Renderer renderer(subject.render);
  double seconds = 0;
  int64_t masked_surfels = 0, masked_pixels = 0;
  for (const View& view : views) {
    FrameRequest request = subject.request;
    // If views were added to the capture since training, its normalisation differs from the run's.
    request.camera = renormalised(view.camera, capture.normalisation, subject.scene.normalisation);
    request.time = view.time;
    const Clock::time_point start = Clock::now();
    const Frame& frame = renderer.forward(subject.scene, request);
    memory::synchronise(subject.scene.device());
    seconds += seconds_since(start);

    const std::shared_ptr<const ViewImages> images = load_images(capture, view);
    const ViewTruth truth = capture.has_truth ? load_truth(capture, view) : ViewTruth{};
    // Copied only if needed, since memory for a photograph matters near the limit.
    const bool is_all_known = images->known.empty();
    ViewImages filled = is_all_known ? ViewImages{} : *images;
    if (!is_all_known) take_unknown(frame.colour.on(Device::cpu), filled);
    const ViewImages& compared = is_all_known ? *images : filled;
    const raster::Output& drawn = frame.raster;
    report.views.push_back(
        {view.id,
         measure({frame.colour, drawn.normal, drawn.depth, drawn.alpha},
                 {compared.colour, compared.mask, truth.normal, &compared.known, &truth.depth, z_per_truth},
                 network),
         view.time});
    if (!images->mask.empty()) {
      masked_surfels += surfels_in_mask(frame, images->mask);
      masked_pixels +=
          std::ranges::count_if(images->mask.values(), [](uint8_t inside) { return inside != 0; });
    }
    if (listener) listener(view, *images, frame);
  }
  if (masked_pixels > 0)
    report.surfels_per_masked_pixel =
        static_cast<double>(masked_surfels) / static_cast<double>(masked_pixels);
  if (seconds > 0) report.render_fps = static_cast<double>(views.size()) / seconds;
  if (motion) report.motion = motion_error(*motion, carriers_of(subject));
}

std::string report_json(const Report& report) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  json["capture"] = report.capture;
  json["split"] = report.split;
  json["views_as_trained"] = report.views_as_trained;
  json["downscale"] = report.downscale;
  json["device"] = report.device;
  json["iterations"] = report.iterations;
  json["train_seconds"] = report.train_seconds;
  json["render_fps"] = figure_json(report.render_fps);
  json["surfels"] = surfels_json(report);
  put_figures(mean_of(report), json["mean"] = nlohmann::ordered_json::object());
  if (report.aligned) put_figures(*report.aligned, json["mean_aligned"] = nlohmann::ordered_json::object());
  json["motion"] = motion_json(report.motion);
  json["views"] = nlohmann::ordered_json::array();
  for (const ViewReport& view : report.views) {
    nlohmann::ordered_json entry = {{"id", view.id}, {"time", view.time}};
    put_figures(view.metrics, entry);
    json["views"].push_back(std::move(entry));
  }
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace traceflow::eval
