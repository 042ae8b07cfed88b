#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "cli/arguments/device_arguments.h"
#include "cli/arguments/option_arguments.h"
#include "cli/verbs/verbs.h"
#include "files/npy.h"
#include "math/spherical_harmonics.h"
#include "ops/deform/deform.h"
#include "ops/trace/trace.h"
#include "splat/splat_file.h"

namespace traceflow::cli {

namespace {

struct TraceArguments {
  std::string ply, rays, output;
  trace::Options options;
};

trace::Rays read_rays(const std::filesystem::path& path) {
  const Tensor<float> rows = read_npy(path);
  if (rows.shape().rank() != 2 || (rows.dim(1) != 6 && rows.dim(1) != 7)) {
    throw InputError(path.string(), "shape", rows.shape().to_string(),
                     "Nx6: origin and direction of each ray; or Nx7: the width of its cone too");
  }
  const bool cones = rows.dim(1) == 7;
  trace::Rays rays{Tensor<float>(Shape{rows.dim(0), 3}), Tensor<float>(Shape{rows.dim(0), 3}),
                   Tensor<float>(Shape{cones ? rows.dim(0) : 0})};
  for (int64_t i = 0; i < rows.dim(0); ++i) {
    std::copy(rows.row(i), rows.row(i) + 3, rays.origins.row(i));
    std::copy(rows.row(i) + 3, rows.row(i) + 6, rays.directions.row(i));
    if (cones) rays.widths[i] = rows(i, 6);
  }
  return rays;
}

void run_trace(const TraceArguments& a, const DeviceArguments& devices) {
  a.options.validate();
  Surfels surfels = read_splat_file(a.ply).surfels;
  trace::Rays rays = read_rays(a.rays);
  const Device device = devices.choose();
  surfels = surfels.on(device);
  rays = rays.on(device);
  PosedSurfels posed;
  deform::forward(surfels, nullptr, 0, {}, sh_degree(surfels.sh.dim(1)), field::Precision::fp32, posed,
                  nullptr);
  const trace::BvhPtr bvh = trace::make_bvh();
  trace::build(posed, a.options, *bvh);
  trace::Output output;
  trace::forward(posed, *bvh, rays, a.options, output, nullptr);

  const std::filesystem::path folder(a.output);
  std::filesystem::create_directories(folder);
  write_npy(folder / "colour.npy", output.colour.on(Device::cpu));
  write_npy(folder / "alpha.npy", output.alpha.on(Device::cpu));
  write_npy(folder / "distance.npy", output.distance.on(Device::cpu));
  fmt::print("{} rays through {} surfels: {}\n", rays.count(), surfels.count(), folder.string());
}

}  // namespace

void add_trace(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("trace", "Trace rays through the surfels of a .ply or an .spz");
  const auto a = std::make_shared<TraceArguments>();
  a->options.t_min = 0;
  verb->add_option("FILE", a->ply, "The surfels, a 2DGS .ply")->required();
  verb->add_option("--rays", a->rays,
                   "The rays, a .npy of Nx6 (origin and direction) or Nx7 (also the width of a cone)")
      ->required();
  verb->add_option("-o,--output", a->output, "Output folder for colour.npy, alpha.npy and distance.npy")
      ->required();
  const OptionArguments options(*verb, option_fields(a->options));
  const DeviceArguments devices(*verb);
  verb->callback([a, options, devices] {
    options.apply(option_fields(a->options));
    run_trace(*a, devices);
  });
}

}  // namespace traceflow::cli
