#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <iostream>
#include <memory>

#include "cli/runs/trained_run.h"
#include "cli/verbs/verbs.h"

namespace traceflow::cli {

namespace {

struct ExportArguments {
  std::string run, output;
  float time = 0;
  bool undeformed = false;
};

void run_export(const ExportArguments& a) {
  // CLI11's range check accepts "nan".
  check_option(a.time >= 0 && a.time <= 1, "time", a.time, "0 to 1");
  const TrainedRun run = read_run(a.run);
  if (!run.note.empty()) std::cerr << run.note << std::endl;
  if (run.subject.request.specular && run.subject.scene.specular == Specular::environment_map) {
    std::cerr
        << "this run's reflections are a cube map, which a .ply cannot hold: main.ply alone is written\n";
  } else if (run.subject.request.specular && run.subject.scene.environment_map) {
    std::cerr << "the cube map behind this run's environment is left out: a .ply cannot hold one\n";
  }
  const std::optional<float> time = a.undeformed ? std::nullopt : std::optional(a.time);
  for (const auto& path : viz::export_subject(run.subject, time, a.output)) fmt::print("{}\n", path.string());
}

}  // namespace

void add_export(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("export", "Write a run's surfels as 2DGS .ply files");
  const auto a = std::make_shared<ExportArguments>();
  verb->add_option("RUN", a->run, "The run's folder")->required();
  verb->add_option("-o,--output", a->output, "Output folder for main.ply and environment.ply")->required();
  CLI::Option* time = verb->add_option("--time", a->time, "Time of the exported surfels, 0 to 1")
                          ->check(CLI::Range(0.0, 1.0))
                          ->capture_default_str();
  verb->add_flag("--undeformed", a->undeformed,
                 "Export the surfels as they are stored, without motion and light changes")
      ->excludes(time);
  verb->callback([a] { run_export(*a); });
}

}  // namespace traceflow::cli
