#include "eval/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "capture/pixels.h"
#include "scene/viewpoint.h"

namespace traceflow::eval {

namespace {

using Json = nlohmann::ordered_json;

void put_metrics(const Metrics& metrics, Json& json) {
  Metrics::visit(metrics, [&](const char* name, const std::optional<double>& value) {
    json[name] = value ? Json(*value) : Json(nullptr);
  });
}

// One line of the table; a figure that cannot be had is a dash.
std::string table_line(const std::string& label, size_t width, const Metrics& m) {
  const auto cell = [](const std::optional<double>& value, int decimals) {
    return value ? fmt::format("{:>10.{}f}", *value, decimals) : fmt::format("{:>10}", "-");
  };
  return fmt::format("{:<{}}", label, width) + cell(m.psnr, 2) + cell(m.ssim, 4) + cell(m.lpips, 4) +
         cell(m.lpips_published, 4) + cell(m.masked_psnr, 2) + cell(m.masked_ssim, 4) +
         cell(m.normal_mae_deg, 2) + cell(m.masked_normal_mae_deg, 2) + "\n";
}

}  // namespace

Metrics mean_of(const Report& report) {
  std::vector<Metrics> all;
  for (const ViewReport& view : report.views) all.push_back(view.metrics);
  return mean(all);
}

void evaluate(const show::Subject& subject, const Capture& capture, const std::vector<View>& views,
              const lpips::Network* network, const ViewListener& listener, Report& report) {
  using Clock = std::chrono::steady_clock;
  report.main_surfels = subject.scene.main.count();
  report.environment_surfels = subject.scene.environment.count();
  Renderer renderer(subject.render);
  double seconds = 0;
  for (const View& view : views) {
    FrameRequest request = subject.request;
    // The capture may have gained views since, and with them another normalisation than the run's.
    request.camera = carried(view.camera, capture.normalisation, subject.scene.normalisation);
    request.time = view.time;
    const Clock::time_point start = Clock::now();
    const Frame& frame = renderer.forward(subject.scene, request);
    memory::synchronise(subject.scene.device());
    seconds += std::chrono::duration<double>(Clock::now() - start).count();

    const std::shared_ptr<const ViewImages> images = load_images(capture, view);
    const ViewTruth truth = capture.has_truth ? load_truth(capture, view) : ViewTruth{};
    // Copied where that is needed alone: at the limit of memory a photograph counts.
    const bool is_all_known = images->known.empty();
    ViewImages filled = is_all_known ? ViewImages{} : *images;
    if (!is_all_known) take_unknown(frame.colour.on(Device::cpu), filled);
    const ViewImages& compared = is_all_known ? *images : filled;
    report.views.push_back({view.id,
                            measure(frame.colour, frame.raster.normal,
                                    {compared.colour, compared.mask, truth.normal, &compared.known}, network),
                            view.time});
    if (listener) listener(view, *images, frame);
  }
  if (seconds > 0) report.render_fps = static_cast<double>(views.size()) / seconds;
}

std::string report_json(const Report& report) {
  Json json;
  json["capture"] = report.capture;
  json["split"] = report.split;
  json["views_as_trained"] = report.views_as_trained;
  json["downscale"] = report.downscale;
  json["device"] = report.device;
  json["iterations"] = report.iterations;
  json["train_seconds"] = report.train_seconds;
  json["render_fps"] = report.render_fps ? Json(*report.render_fps) : Json(nullptr);
  json["surfels"] = {{"main", report.main_surfels}, {"environment", report.environment_surfels}};
  put_metrics(mean_of(report), json["mean"]);
  json["views"] = Json::array();
  for (const ViewReport& view : report.views) {
    Json entry;
    entry["id"] = view.id;
    put_metrics(view.metrics, entry);
    json["views"].push_back(std::move(entry));
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string report_table(const Report& report) {
  size_t width = 6;
  for (const ViewReport& view : report.views) width = std::max(width, view.id.size() + 1);
  std::string text =
      fmt::format("{:<{}}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}\n", "view", width, "PSNR", "SSIM",
                  "LPIPS", "LPIPS-pub", "mPSNR", "mSSIM", "normal°", "mnormal°");
  for (const ViewReport& view : report.views) text += table_line(view.id, width, view.metrics);
  return text + table_line("mean", width, mean_of(report));
}

}  // namespace traceflow::eval
