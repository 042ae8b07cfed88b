#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/arguments/option_arguments.h"
#include "cli/runs/capture_report.h"
#include "cli/verbs/verbs.h"
#include "files/png.h"
#include "viz/capture_picture/capture_picture.h"

namespace traceflow::cli {

namespace {

struct InspectArguments {
  std::string data;
  std::string preset_name = "paper";
  std::string picture;
  bool as_json = false;
  bool quick = false;
};

void inspect_capture(const InspectArguments& arguments, const OptionArguments& given) {
  TrainOptions options = preset(arguments.preset_name);
  given.apply(option_fields(options));
  options.validate();
  const Capture capture = load_capture(arguments.data, options.capture);
  Inspection found = inspect(capture, arguments.quick);
  const MemoryNeeds memory = memory_needs(capture, options, found);
  if (!arguments.picture.empty()) write_png(arguments.picture, viz::capture_picture(capture, found.findings));
  if (arguments.as_json) {
    const nlohmann::json report = report_json(capture, found, memory);
    // In ASCII: names are untrusted, and other characters include terminal control codes.
    fmt::print("{}\n", report.dump(2, ' ', true, nlohmann::json::error_handler_t::replace));
  } else {
    print_report(capture, found, memory);
  }
}

}  // namespace

void add_inspect(CLI::App& program) {
  CLI::App* verb =
      program.add_subcommand("inspect", "List what a capture holds and lacks, and what looks wrong.");
  const auto arguments = std::make_shared<InspectArguments>();
  verb->add_option("-d,--data", arguments->data, "The capture: a folder or a zip archive")
      ->required()
      ->option_text("CAPTURE");
  verb->add_flag("--json", arguments->as_json, "Print one JSON object (docs/inspect.md)");
  verb->add_option("--picture", arguments->picture, "Draw views, cameras and points into this PNG file")
      ->option_text("FILE");
  verb->add_flag("--quick", arguments->quick,
                 "Decode only 32 views of each split, and do not compare neighbours");
  verb->add_option("--preset", arguments->preset_name,
                   "Preset whose training memory is estimated, with the settings below, as in train; the "
                   "defaults shown are those of paper")
      ->option_text("NAME")
      ->type_name("{paper,cpu,demo}")
      ->capture_default_str();
  const auto defaults = std::make_shared<TrainOptions>(preset(arguments->preset_name));
  const auto given =
      std::make_shared<OptionArguments>(*verb, option_fields(*defaults), std::vector<std::string>{"capture"});
  verb->callback([arguments, given] { inspect_capture(*arguments, *given); });
}

}  // namespace traceflow::cli
