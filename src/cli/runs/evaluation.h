#pragma once

#include <string>

#include "cli/arguments/device_arguments.h"
#include "eval/report_page.h"
#include "runs/trained_run.h"

namespace traceflow::cli {

// Arguments of both `eval` and `report`.
struct EvaluationArguments {
  std::string run, capture, split = "test", lpips;
  int downscale = 0;
  bool align_cameras = false;
};
void add_evaluation_arguments(CLI::App& verb, EvaluationArguments& arguments);

// A run and the views on which it is measured.
class Evaluation {
 public:
  // Reads the run, the capture and, if given, the weights of LPIPS. Prints to standard error what is missing.
  // Throws InputError.
  Evaluation(const EvaluationArguments& arguments, const DeviceArguments& devices);

  // Renders and measures every view; the listener may be empty. Also measures with aligned cameras if
  // requested, or if these are held-out views of a run that refined its cameras.
  void measure(const eval::ViewListener& listener);
  // Writes the results as a page (eval/report_page.h).
  void write_page(const std::filesystem::path& path);

  const eval::Report& report() const { return report_; }
  const std::vector<View>& views() const { return *views_; }
  double scale() const { return run_.subject.scene.normalisation.scale; }
  const viz::Subject& subject() const { return run_.subject; }
  const Capture& capture() const { return capture_; }

 private:
  // The views with cameras aligned to their photographs.
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
