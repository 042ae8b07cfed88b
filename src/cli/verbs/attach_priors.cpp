#include "prepare/attach_priors.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "base/work.h"
#include "cli/arguments/option_arguments.h"
#include "cli/terminal/error_boundary.h"
#include "cli/terminal/stop_request.h"
#include "cli/verbs/verbs.h"

namespace traceflow::cli {

void add_attach_priors(CLI::App& program) {
  struct Arguments {
    std::string capture;
    prepare::AttachOptions options;
  };
  CLI::App* verb = program.add_subcommand(
      "attach-priors", "Add normals, masks, tracks and depths of other programs to a capture.");
  const auto a = std::make_shared<Arguments>();
  verb->add_option("-d,--data", a->capture, "The capture's folder")->required()->option_text("CAPTURE");
  const OptionArguments given(*verb, option_fields(a->options));
  verb->callback([a, given] {
    given.apply(option_fields(a->options));
    try {
      prepare::attach_priors(
          a->capture, a->options, [](const std::string& line) { fmt::print(stderr, "{}\n", line); },
          stop_on_signals());
    } catch (const Stopped&) {
      fmt::print(stderr, "stopped; the capture is as it was\n");
      throw Exit{exit_interrupted};
    }
  });
}

}  // namespace traceflow::cli
