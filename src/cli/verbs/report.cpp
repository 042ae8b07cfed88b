#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "cli/runs/evaluation.h"
#include "cli/verbs/verbs.h"

namespace traceflow::cli {

namespace {

struct ReportArguments {
  EvaluationArguments evaluation;
  std::string output;
};

void run_report(const ReportArguments& a, const DeviceArguments& devices) {
  const std::filesystem::path usual = std::filesystem::path(a.evaluation.run) / "report.html";
  const std::filesystem::path path = a.output.empty() ? usual : std::filesystem::path(a.output);
  if (std::filesystem::is_directory(path)) {
    throw InputError("option", "output", path.string() + ", a folder", "a file to write, FILE.html");
  }
  Evaluation evaluation(a.evaluation, devices);
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path());
  evaluation.measure({});
  evaluation.write_page(path);
  fmt::print("{}\n", path.string());
}

}  // namespace

void add_report(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("report", "Write an HTML report of a run");
  const auto a = std::make_shared<ReportArguments>();
  add_evaluation_arguments(*verb, a->evaluation);
  verb->add_option("-o,--output", a->output, "Output file; default: RUN/report.html");
  const DeviceArguments devices(*verb);
  verb->callback([a, devices] { run_report(*a, devices); });
}

}  // namespace traceflow::cli
