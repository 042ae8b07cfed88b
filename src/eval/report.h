#pragma once

#include <functional>
#include <string>
#include <vector>

#include "capture/capture.h"
#include "eval/metrics.h"
#include "eval/motion_error.h"
#include "viz/subject.h"

namespace traceflow::eval {

struct ViewReport {
  std::string id;
  Metrics metrics;
  float time = 0;  // in [0, 1]
};

// What is known of a scene's quality: the content of metrics.json.
struct Report {
  std::string capture;
  std::string split;             // "test" or "train"
  bool views_as_trained = true;  // else times and splits may be others than the run's
  int downscale = 1;
  std::string device = "cpu";
  int64_t iterations = 0;
  double train_seconds = 0;
  std::optional<double> render_fps;  // frames a second, rendering alone
  int64_t main_surfels = 0;
  int64_t environment_surfels = 0;
  // Main surfels that show in the masks (eval/surfel_density.h), over the masks' pixels.
  std::optional<double> surfels_per_masked_pixel;
  std::vector<ViewReport> views;
  std::optional<Metrics> aligned;      // means with aligned cameras, where those were asked for
  std::optional<MotionReport> motion;  // where the capture has truth/motion
};

// Called with each view's photograph and frame, in order.
using ViewListener = std::function<void(const View& view, const ViewImages& images, const Frame& frame)>;

// Renders every view, measures it, and adds it to the report; sets render_fps, the surfel counts and the
// motion. Throws InputError for truth that cannot be used.
void evaluate(const viz::Subject& subject, const Capture& capture, const std::vector<View>& views,
              const lpips::Network* network, const ViewListener& listener, Report& report);

// Each figure's mean over the report's views that have it.
Metrics mean_of(const Report& report);

// The report as JSON text: figures that cannot be had are null.
std::string report_json(const Report& report);

// The report as a table: a line for each view and one for the mean, a column for each figure that some view
// has; below it the motion of each thing.
std::string report_table(const Report& report);

}  // namespace traceflow::eval
