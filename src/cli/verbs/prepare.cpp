#include "prepare/prepare.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "cli/arguments/option_arguments.h"
#include "cli/terminal/error_boundary.h"
#include "cli/terminal/stop_request.h"
#include "cli/verbs/verbs.h"

namespace traceflow::cli {

namespace {

struct PrepareArguments {
  std::string input, capture;
  prepare::PrepareOptions options;
};

void run_prepare(const PrepareArguments& a) {
  const auto say = [](const std::string& line) { fmt::print(stderr, "{}\n", line); };
  if (!prepare::prepare_capture(a.input, a.capture, a.options, say, stop_on_signals())) {
    say("stopped; the same command goes on with the step that it was in");
    throw Exit{exit_interrupted};
  }
}

}  // namespace

void add_prepare(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("prepare", "Make a capture of a film, with ffmpeg and COLMAP.");
  const auto a = std::make_shared<PrepareArguments>();
  verb->add_option("INPUT", a->input, "A film, or a folder of pictures")->required();
  verb->add_option("-o,--output", a->capture, "The capture's folder")->required()->option_text("CAPTURE");
  const OptionArguments given(*verb, option_fields(a->options));
  verb->callback([a, given] {
    given.apply(option_fields(a->options));
    run_prepare(*a);
  });
}

}  // namespace traceflow::cli
