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

// The content of metrics.json.
struct Report {
  std::string capture;
  std::string split;             // "test" or "train"
  bool views_as_trained = true;  // if false, times and splits may differ from the run's
  int downscale = 1;
  std::string device = "cpu";
  int64_t iterations = 0;
  double train_seconds = 0;
  std::optional<double> render_fps;  // frames per second, rendering only
  int64_t main_surfels = 0;
  int64_t environment_surfels = 0;
  // Visible main surfels in the masks (eval/surfel_density.h), per pixel of the masks.
  std::optional<double> surfels_per_masked_pixel;
  std::vector<ViewReport> views;
  std::optional<Metrics> aligned;      // means with aligned cameras, if measured
  std::optional<MotionReport> motion;  // if the capture has truth/motion
};

// Called for each view in order, with its photograph and rendered frame.
using ViewListener = std::function<void(const View& view, const ViewImages& images, const Frame& frame)>;

// Renders and measures every view and adds it to the report. Sets render_fps, the surfel counts and the
// motion. Throws InputError for invalid ground truth.
void evaluate(const viz::Subject& subject, const Capture& capture, const std::vector<View>& views,
              const lpips::Network* network, const ViewListener& listener, Report& report);

// The mean of each metric over the report's views that have it.
Metrics mean_of(const Report& report);

// The report as JSON text; unavailable metrics are null.
std::string report_json(const Report& report);

// The report as a table: a line for each view and one for the mean, a column for each metric that any view
// has. The motion of each object follows.
std::string report_table(const Report& report);

}  // namespace traceflow::eval
