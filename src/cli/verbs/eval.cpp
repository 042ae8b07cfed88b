#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <memory>
#include <optional>

#include "base/atomic_file.h"
#include "cli/runs/evaluation.h"
#include "cli/verbs/verbs.h"
#include "viz/contact_sheet.h"
#include "viz/layer_files.h"

namespace traceflow::cli {

namespace {

struct EvalArguments {
  EvaluationArguments evaluation;
  std::string layers = "rgb,diffuse,specular,tint,alpha,normal,depth", sheet;
  int sheet_views = 4;
  int sheet_width = 240;
};

void run_eval(const EvalArguments& a, const DeviceArguments& devices) {
  const std::vector<viz::Layer> layers =
      a.layers == "none" ? std::vector<viz::Layer>{} : viz::parse_layers(a.layers);
  Evaluation evaluation(a.evaluation, devices);
  const std::vector<View>& views = evaluation.views();

  const std::filesystem::path folder = std::filesystem::path(a.evaluation.run) / "eval" / a.evaluation.split;
  std::filesystem::create_directories(folder);
  viz::LayerFiles files(folder, layers, viz::ImageFormat::png, evaluation.scale());
  std::optional<viz::TrackFollower> follower;
  const viz::Subject& subject = evaluation.subject();
  if (std::ranges::find(layers, viz::Layer::tracks) != layers.end())
    follower.emplace(subject.scene, subject.request, subject.render, times_of(evaluation.capture()));
  viz::ContactSheet sheet(a.sheet_width);
  evaluation.measure([&](const View& view, const ViewImages& images, const Frame& frame) {
    files.write(view.id, frame, follower ? follower->at(subject.scene, view.time) : viz::Tracks());
    const auto i = static_cast<size_t>(&view - views.data());
    if (!a.sheet.empty() && eval::among_spread(i, views.size(), static_cast<size_t>(a.sheet_views))) {
      sheet.add(images.colour, frame, images.known);
    }
  });
  if (!a.sheet.empty()) sheet.write(a.sheet);
  write_atomically(folder / "metrics.json", eval::report_json(evaluation.report()));
  evaluation.write_page(folder / "report.html");
  fmt::print("{}{}\n{}\n", eval::report_table(evaluation.report()), (folder / "metrics.json").string(),
             (folder / "report.html").string());
}

}  // namespace

void add_eval(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("eval", "Measure a run on the views of its capture");
  const auto a = std::make_shared<EvalArguments>();
  add_evaluation_arguments(*verb, a->evaluation);
  verb->add_option("--layers", a->layers, "Layers to write as pictures, separated by commas; all; or none")
      ->capture_default_str();
  verb->add_option("--contact-sheet", a->sheet,
                   "Also write one picture with every layer of some views to this file");
  verb->add_option("--sheet-views", a->sheet_views, "Number of views on the contact sheet")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  verb->add_option("--sheet-width", a->sheet_width, "Width of each picture on the contact sheet, in pixels")
      ->check(CLI::Range(16, 4096))
      ->capture_default_str();
  const DeviceArguments devices(*verb);
  verb->callback([a, devices] { run_eval(*a, devices); });
}

}  // namespace traceflow::cli
