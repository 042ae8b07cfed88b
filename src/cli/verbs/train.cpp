#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <optional>

#include "base/clock.h"
#include "cli/arguments/device_arguments.h"
#include "cli/arguments/option_arguments.h"
#include "cli/arguments/server_arguments.h"
#include "cli/terminal/count_progress.h"
#include "cli/terminal/error_boundary.h"
#include "cli/terminal/progress.h"
#include "cli/terminal/stop_request.h"
#include "cli/verbs/verbs.h"
#include "record/log_history.h"
#include "runs/run_training.h"
#include "runs/trained_run.h"
#include "serve/live_view.h"
#include "train/continuation.h"

namespace traceflow::cli {

namespace {

struct TrainArguments {
  std::string data;
  std::string output;
  std::string preset_name = "paper";
  bool resume = false;
  bool quiet = false;
  bool view = false;
  serve::ViewOptions view_options;
  const CLI::Option* preset = nullptr;

  bool names_preset() const { return preset->count() > 0; }
};

// The run's settings: from the checkpoint when resuming, else from the preset. The command line overrides
// both.
TrainOptions settings(const TrainArguments& arguments, const OptionArguments& given, const RunTraining& run) {
  const auto with_given = [&](TrainOptions options) {
    given.apply(option_fields(options));
    return options;
  };
  const auto of_preset = [&] { return with_given(preset(arguments.preset_name)); };
  TrainOptions options = arguments.resume ? with_given(run.checkpoint().options) : of_preset();
  run.check(options);
  if (arguments.resume && arguments.names_preset())
    refuse_other_preset(arguments.preset_name, of_preset(), options);
  return options;
}

// A quiet run still reports why it ended early.
[[noreturn]] void end_with(int code, const TrainArguments& arguments, const events::Finished& end) {
  if (arguments.quiet && code != exit_interrupted) {
    std::cerr << fmt::format("traceflow: ended at iteration {}: {}\n", end.iteration, end.reason);
  }
  throw Exit{code};
}

// A training with its server for viewers.
class Watched {
 public:
  Watched(Trainer& trainer, const TrainArguments& arguments, const ServerArguments& where,
          const std::atomic<bool>& stop)
      : view_(arguments.view_options,
              serve::make_scene_info("training", run_name(arguments.output), &trainer.capture(),
                                     trainer.scene().normalisation),
              {[&trainer] { return stage_of(trainer); }, [&trainer] { trainer.save(); },
               [&trainer](const events::Event& event) { trainer.stream().emit(event); },
               [&trainer] { trainer.stop_soon(); }, &stop}) {
    view_.restore_log(read_log(RunFolder{arguments.output}.log()));
    server_ = where.start(view_.handler());
    trainer.stream().listen([this](const events::Event& event) { view_(event); });
  }

  // After the training: serves until the last page is closed.
  void stay(bool quiet) {
    if (!view_.is_wanted()) return;
    if (!quiet) std::cerr << "still shown to those who look; Ctrl-C ends it\n";
    view_.stay();
  }

 private:
  static serve::SceneView stage_of(const Trainer& trainer) {
    return {trainer.scene(), picture_render(trainer.options(), trainer.iteration()),
            picture_request(trainer.options(), trainer.iteration()), trainer.iteration()};
  }

  serve::LiveView view_;
  std::unique_ptr<serve::Server> server_;
};

// The objects to follow. Shows the progress of the search.
RunTraining::ObjectSearch objects_for(const RunTraining& run, Capture& capture, const TrainOptions& options,
                                      const TrainArguments& arguments, const std::atomic<bool>& stop) {
  const Clock::time_point start = Clock::now();
  CountProgress progress = CountProgress::for_stderr();
  RunTraining::ObjectSearch objects = run.objects_for(capture, options, [&](int64_t done, int64_t all) {
    if (!arguments.quiet) progress.show({"masks", "iterations", done, all}, seconds_since(start));
    return !stop;
  });
  progress.finish();
  if (objects.stopped) throw Exit{exit_interrupted};
  if (objects.found && !arguments.resume && !arguments.quiet) {
    const FoundMasks& masks = objects.found->masks;
    std::cerr << fmt::format(
        "found what moves in {} pictures without masks: {:.1f}% of their pixels, as {} shows ({})\n",
        masks.size(), 100 * covered_share(masks), RunFolder{arguments.output}.masks().string(),
        duration_text(seconds_since(start)));
  }
  return objects;
}

void train(const TrainArguments& arguments, const OptionArguments& given, const DeviceArguments& devices,
           const ServerArguments& where) {
  arguments.view_options.validate();
  RunTraining run(arguments.output, arguments.resume);
  const TrainOptions options = settings(arguments, given, run);
  std::string data = arguments.data;
  if (data.empty()) data = run.checkpoint().capture_folder;
  if (data.empty()) throw InputError("--data", "", "nothing", "a capture: a folder or a zip archive");

  Capture capture = load_capture(data, options.capture);
  const Device device = devices.choose(arguments.quiet);
  const std::atomic<bool>& stop = stop_on_signals();
  const RunTraining::ObjectSearch objects = objects_for(run, capture, options, arguments, stop);
  const std::unique_ptr<Trainer> held = run.trainer(options, std::move(capture), device, objects);
  Trainer& trainer = *held;
  if (arguments.quiet) {
    trainer.stream().listen(warnings_alone(std::cerr));
  } else {
    trainer.stream().listen(Progress::for_stderr());
  }
  run.begin(trainer);
  std::optional<Watched> watched;
  if (arguments.view) watched.emplace(trainer, arguments, where, stop);

  const events::Finished end = trainer.run(stop);
  if (watched) watched->stay(arguments.quiet);
  if (end.ending == events::Ending::diverged) end_with(exit_diverged, arguments, end);
  if (end.ending == events::Ending::out_of_memory) end_with(exit_memory, arguments, end);
  if (end.ending == events::Ending::no_input) end_with(exit_input, arguments, end);
  if (end.ending == events::Ending::interrupted) end_with(exit_interrupted, arguments, end);
}

}  // namespace

void add_train(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("train", "Reconstruct a scene from a capture.");
  auto arguments = std::make_shared<TrainArguments>();
  verb->add_option("-d,--data", arguments->data, "The capture: a folder or a zip archive")
      ->option_text("CAPTURE");
  verb->add_option("-o,--output", arguments->output, "The run's folder, for checkpoints and log")
      ->required()
      ->option_text("RUN");
  arguments->preset =
      verb->add_option("--preset", arguments->preset_name,
                       "Preset: paper (60,000 iterations; its values are the defaults below), cpu (a quarter "
                       "of an hour on two cores at 240x135) or demo (a few minutes)")
          ->option_text("NAME")
          ->type_name("{paper,cpu,demo}")
          ->capture_default_str();
  verb->add_flag("--resume", arguments->resume, "Continue the run from its checkpoint, with its settings");
  verb->add_flag("-q,--quiet", arguments->quiet, "Print only warnings and errors");
  CLI::Option* view =
      verb->add_flag("--view", arguments->view, "Show the training in a browser (docs/view.md)");
  verb->add_option("--view-share", arguments->view_options.share,
                   "Maximum share of the training time that open pages may use")
      ->needs(view)
      ->option_text("X")
      ->capture_default_str();
  const ServerArguments where(*verb, view);
  // Presets differ only in values, so any of them gives the flags.
  auto defaults = std::make_shared<TrainOptions>(preset(arguments->preset_name));
  auto given =
      std::make_shared<OptionArguments>(*verb, option_fields(*defaults), std::vector<std::string>{"capture"});
  const DeviceArguments devices(*verb);
  verb->callback([arguments, given, devices, where] { train(*arguments, *given, devices, where); });
}

}  // namespace traceflow::cli
