#include <CLI/CLI.hpp>

#include <memory>
#include <string>

#include "capture/synth/synth.h"
#include "cli/arguments/option_arguments.h"
#include "cli/verbs/verbs.h"

namespace traceflow::cli {

void add_synth(CLI::App& program) {
  struct Arguments {
    std::string folder;
    SynthOptions options;
  };
  CLI::App* verb =
      program.add_subcommand("synth", "Make a synthetic capture of moving objects, with ground truth");
  const auto arguments = std::make_shared<Arguments>();
  verb->add_option("OUT", arguments->folder,
                   "Output folder: new, empty, or an earlier synthetic capture, which is replaced")
      ->required();
  const OptionArguments flags(*verb, option_fields(arguments->options));
  verb->callback([arguments, flags] {
    flags.apply(option_fields(arguments->options));
    write_synthetic_capture(arguments->options, arguments->folder);
  });
}

}  // namespace traceflow::cli
