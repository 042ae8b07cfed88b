#include "prepare/prepare.h"

#include <fmt/format.h>

#include <chrono>
#include <CLI/CLI.hpp>
#include <memory>

#include "cli/arguments/option_arguments.h"
#include "cli/terminal/count_progress.h"
#include "cli/terminal/error_boundary.h"
#include "cli/terminal/stop_request.h"
#include "cli/verbs/verbs.h"
#include "prepare/steps.h"

namespace traceflow::cli {

namespace {

struct PrepareArguments {
  std::string input, capture;
  prepare::PrepareOptions options;
};

// Prints a line for each finished step, and below it the progress of the present step.
class Watcher {
 public:
  void found(const std::string& line) {
    progress_.finish();
    fmt::print(stderr, "{}\n", line);
  }
  void at_work(prepare::Step step, int64_t done, int64_t all) {
    const auto now = std::chrono::steady_clock::now();
    // A step may count several times: it first analyses images, then writes them.
    if (done == 0 || done < done_) began_ = now;
    done_ = done;
    progress_.show({prepare::step_name(step), "", done, all},
                   std::chrono::duration<double>(now - began_).count());
  }

 private:
  CountProgress progress_ = CountProgress::for_stderr();
  std::chrono::steady_clock::time_point began_;
  int64_t done_ = 0;
};

void run_prepare(const PrepareArguments& a) {
  Watcher watcher;
  const prepare::ProgressCallbacks callbacks{
      [&](const std::string& line) { watcher.found(line); },
      [&](prepare::Step step, int64_t done, int64_t all) { watcher.at_work(step, done, all); }};
  if (prepare::prepare_capture(a.input, a.capture, a.options, callbacks, stop_on_signals())) return;
  watcher.found("stopped; the same command goes on with the step that it was in");
  throw Exit{exit_interrupted};
}

}  // namespace

void add_prepare(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("prepare", "Make a capture from a video, with ffmpeg and COLMAP.");
  const auto a = std::make_shared<PrepareArguments>();
  verb->add_option("INPUT", a->input, "A video, or a folder of images")->required();
  verb->add_option("-o,--output", a->capture, "The capture's folder")->required()->option_text("CAPTURE");
  const OptionArguments given(*verb, option_fields(a->options));
  verb->callback([a, given] {
    given.apply(option_fields(a->options));
    run_prepare(*a);
  });
}

}  // namespace traceflow::cli
