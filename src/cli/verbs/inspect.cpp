#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "capture/inspect.h"
#include "capture/prior_axes.h"
#include "cli/arguments/option_arguments.h"
#include "cli/verbs/verbs.h"

namespace traceflow::cli {

namespace {

nlohmann::json to_json(const Vec3<double>& v) { return {v.x, v.y, v.z}; }

nlohmann::json to_json(const Inspection::Split& split) {
  return {{"views", split.views},
          {"masks", split.masks},
          {"normal_priors", split.normal_priors},
          {"truth_normals", split.truth_normals},
          {"truth_depths", split.truth_depths},
          {"times", split.times},
          {"time_range", {split.first_time, split.last_time}}};
}

nlohmann::json to_json(const Capture& capture, const Inspection& found) {
  nlohmann::json sizes = nlohmann::json::array();
  for (const auto& [size, views] : found.sizes) {
    sizes.push_back({{"width", size.first}, {"height", size.second}, {"views", views}});
  }
  nlohmann::json points = {{"count", capture.points.empty() ? 0 : capture.points.dim(0)}};
  if (!capture.points.empty()) points["box"] = {to_json(found.points_low), to_json(found.points_high)};
  return {{"name", capture.name},
          {"format", capture.format},
          {"train", to_json(found.train)},
          {"test", to_json(found.test)},
          {"images",
           {{"folder", found.image_folder},
            {"box_factor", found.box_factor},
            {"sizes", sizes},
            {"resampled_views", found.resampled_views},
            {"largest_zoom", found.largest_zoom}}},
          {"cameras",
           {{"extent", capture.extent},
            {"box", {to_json(found.camera_low), to_json(found.camera_high)}},
            {"turn_degrees", found.camera_turn_degrees},
            {"field_of_view_degrees", found.field_of_view_degrees},
            {"near", capture.near_plane},
            {"far", capture.far_plane}}},
          {"normalisation",
           {{"centre", to_json(capture.normalisation.centre)}, {"scale", capture.normalisation.scale}}},
          {"points", points},
          {"prior_axes",
           capture.has_normal_priors ? nlohmann::json(prior_axes_name(capture.prior_axes)) : nullptr},
          {"decoded",
           {{"views", found.pixels.views},
            {"mean_colour", found.pixels.mean_colour},
            {"masked", found.pixels.masked},
            {"with_prior", found.pixels.with_prior}}},
          {"missing", found.missing},
          {"warnings", found.warnings}};
}

void row(const std::string& name, const std::string& text) { fmt::print("{:<16}{}\n", name, text); }

void row(const std::string& name, const Inspection::Split& split) {
  row(name,
      fmt::format("{} views at {} times from {:.3f} to {:.3f}; {} masks, {} normal priors, {} true normals, "
                  "{} true depths",
                  split.views, split.times, split.first_time, split.last_time, split.masks,
                  split.normal_priors, split.truth_normals, split.truth_depths));
}

std::string box(const Vec3<double>& low, const Vec3<double>& high) {
  return fmt::format("({:.3f} {:.3f} {:.3f}) to ({:.3f} {:.3f} {:.3f})", low.x, low.y, low.z, high.x, high.y,
                     high.z);
}

void print(const Capture& capture, const Inspection& found) {
  row("capture", fmt::format("{} ({})", capture.name, capture.format));
  row("train", found.train);
  row("test", found.test);
  for (const auto& [size, views] : found.sizes)
    row("images", fmt::format("{} of {}×{}", views, size.first, size.second));
  row("", fmt::format("from {}{}{}", found.image_folder,
                      found.box_factor > 1 ? fmt::format(", box-filtered by {}", found.box_factor) : "",
                      found.resampled_views > 0 ? fmt::format(", {} straightened (zoom up to {:.3f})",
                                                              found.resampled_views, found.largest_zoom)
                                                : ""));
  row("cameras",
      fmt::format("extent {:.3f}, box {}", capture.extent, box(found.camera_low, found.camera_high)));
  row("", fmt::format("turning by up to {:.0f}°, {:.0f}° wide", found.camera_turn_degrees,
                      found.field_of_view_degrees));
  if (capture.far_plane > 0)
    row("depth", fmt::format("{:.3f} to {:.3f}", capture.near_plane, capture.far_plane));
  if (!capture.points.empty()) {
    row("points", fmt::format("{} in {}", capture.points.dim(0), box(found.points_low, found.points_high)));
  }
  if (capture.has_masks) row("masks", fmt::format("cover {:.1f}% of the pixels", 100 * found.pixels.masked));
  if (capture.has_normal_priors) {
    row("normal priors", fmt::format("axes {}, on {:.1f}% of the pixels", prior_axes_name(capture.prior_axes),
                                     100 * found.pixels.with_prior));
  }
  for (const std::string& text : found.missing) row("missing", text);
  for (const std::string& text : found.warnings) row("warning", text);
  if (found.warnings.empty()) row("warnings", "none");
}

}  // namespace

void add_inspect(CLI::App& program) {
  CLI::App* verb =
      program.add_subcommand("inspect", "Tell what a capture holds, what it lacks, and what looks wrong.");
  const auto folder = std::make_shared<std::string>();
  const auto as_json = std::make_shared<bool>(false);
  const auto options = std::make_shared<CaptureOptions>();
  verb->add_option("-d,--data", *folder, "The capture's folder.")->required();
  verb->add_flag("--json", *as_json, "Print one JSON object (docs/inspect.md).");
  const OptionArguments arguments(*verb, option_fields(*options));
  verb->callback([=] {
    arguments.apply(option_fields(*options));
    const Capture capture = load_capture(*folder, *options);
    const Inspection found = inspect(capture);
    if (*as_json) {
      fmt::print("{}\n", to_json(capture, found).dump(2));
    } else {
      print(capture, found);
    }
  });
}

}  // namespace traceflow::cli
