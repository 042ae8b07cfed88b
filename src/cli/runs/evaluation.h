#pragma once

#include <string>

#include "cli/arguments/device_arguments.h"
#include "cli/runs/trained_run.h"
#include "eval/report_page.h"

namespace traceflow::cli {

// What `eval` and `report` are both told.
struct EvaluationArguments {
  std::string run, capture, split = "test", lpips;
  int downscale = 0;
  bool align_cameras = false;
};
void add_evaluation_arguments(CLI::App& verb, EvaluationArguments& arguments);

// A run and the views that it is measured on.
class Evaluation {
 public:
  // Reads the run, the capture and, where they are given, LPIPS's weights; says on standard error what is
  // missing. Throws InputError.
  Evaluation(const EvaluationArguments& arguments, const DeviceArguments& devices);

  // Renders and measures every view; the listener may be empty. Where it is asked for, or held-out views are
  // measured of a run that refined its cameras, measures them with aligned cameras too.
  void measure(const eval::ViewListener& listener);
  // What has been measured, as a page (eval/report_page.h).
  void write_page(const std::filesystem::path& path);

  const eval::Report& report() const { return report_; }
  const std::vector<View>& views() const { return *views_; }
  double scale() const { return run_.subject.scene.normalisation.scale; }
  const viz::Subject& subject() const { return run_.subject; }
  const Capture& capture() const { return capture_; }

 private:
  // The views with cameras from which they look most like their photographs.
  std::vector<View> aligned_views();

  std::filesystem::path folder_;
  TrainedRun run_;
  Capture capture_;
  const std::vector<View>* views_;
  std::optional<lpips::Network> network_;
  Device device_ = Device::cpu;
  bool aligns_;
  eval::Report report_;
  eval::ReportPictures pictures_;
};

}  // namespace traceflow::cli
