#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "base/atomic_file.h"
#include "cli/device_arguments.h"
#include "cli/trained_run.h"
#include "cli/verbs.h"
#include "eval/report.h"
#include "show/camera_file.h"
#include "show/contact_sheet.h"
#include "show/layer_files.h"

namespace traceflow::cli {

namespace {

struct EvalArguments {
  std::string run, capture, split = "test", lpips, layers = "rgb,diffuse,specular,tint,alpha,normal,depth",
                            sheet;
  int downscale = 0;
  int sheet_views = 4;
  int sheet_width = 240;
};

// Whether view i of n is among `wanted` views spread evenly.
bool on_sheet(size_t i, size_t n, size_t wanted) {
  const size_t shown = std::min(n, wanted);
  for (size_t k = 0; k < shown; ++k) {
    if (i == (2 * k + 1) * n / (2 * shown)) return true;
  }
  return false;
}

std::optional<lpips::Network> read_lpips(const std::string& path) {
  if (!path.empty()) return lpips::network_of(lpips::read_weights(path));
  fmt::print(stderr,
             "LPIPS is null: it needs weights. scripts/export_lpips.py writes them, --lpips FILE reads them "
             "(docs/eval.md)\n");
  return std::nullopt;
}

void run_eval(const EvalArguments& a, const DeviceArguments& devices) {
  const std::vector<show::Layer> layers =
      a.layers == "none" ? std::vector<show::Layer>{} : show::parse_layers(a.layers);
  TrainedRun run = read_run(a.run);
  if (!run.note.empty()) fmt::print(stderr, "{}\n", run.note);
  const Capture capture = capture_of(run, a.capture, a.downscale);
  const std::vector<View>& views = views_of(capture, a.split);
  for (const View& view : views) show::check_name(capture.folder.string(), "view id", view.id);
  std::optional<lpips::Network> network = read_lpips(a.lpips);
  const Device device = devices.choose();
  run.subject.scene.move_to(device);
  if (network) network = network->on(device);

  const std::filesystem::path folder = std::filesystem::path(a.run) / "eval" / a.split;
  std::filesystem::create_directories(folder);
  show::LayerFiles files(folder, layers, show::ImageFormat::png, run.subject.scene.normalisation.scale);
  show::ContactSheet sheet(a.sheet_width);
  eval::Report report;
  report.capture = capture.name;
  report.split = a.split;
  report.downscale = a.downscale > 0 ? a.downscale : run.options.capture.downscale;
  report.device = name_of(device);
  report.iterations = run.iterations;
  report.train_seconds = run.train_seconds;
  eval::evaluate(
      run.subject, capture, views, network ? &*network : nullptr,
      [&](const View& view, const ViewImages& images, const Frame& frame) {
        files.write(view.id, frame);
        const auto i = static_cast<size_t>(&view - views.data());
        if (!a.sheet.empty() && on_sheet(i, views.size(), static_cast<size_t>(a.sheet_views))) {
          sheet.add(images.colour, frame);
        }
      },
      report);
  if (!a.sheet.empty()) sheet.write(a.sheet);
  write_atomically(folder / "metrics.json", eval::report_json(report));
  fmt::print("{}{}\n", eval::report_table(report), (folder / "metrics.json").string());
}

}  // namespace

void add_eval(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("eval", "Measure a run on views of its capture");
  const auto a = std::make_shared<EvalArguments>();
  verb->add_option("RUN", a->run, "Folder of the run")->required();
  verb->add_option("--split", a->split, "Views to measure: test or train")
      ->check(CLI::IsMember({"test", "train"}));
  verb->add_option("-d,--data", a->capture, "The capture's folder, where it is not where the run found it");
  verb->add_option("--downscale", a->downscale, "Measure at another size than the run was trained at")
      ->check(CLI::Range(1, 64));
  verb->add_option("--lpips", a->lpips, "Weights for LPIPS, as scripts/export_lpips.py writes them")
      ->envname("TRACEFLOW_LPIPS");
  verb->add_option("--layers", a->layers, "Layers to write as pictures, with commas between; all; or none")
      ->capture_default_str();
  verb->add_option("--contact-sheet", a->sheet, "Also write one picture of every layer of a few views");
  verb->add_option("--sheet-views", a->sheet_views, "Views on the contact sheet")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  verb->add_option("--sheet-width", a->sheet_width, "Columns of one picture on it, pixels")
      ->check(CLI::Range(16, 4096))
      ->capture_default_str();
  const DeviceArguments devices(*verb);
  verb->callback([a, devices] { run_eval(*a, devices); });
}

}  // namespace traceflow::cli
