#include "cli/runs/capture_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "base/machine.h"
#include "base/printable.h"
#include "capture/image_cache.h"
#include "capture/prior_axes.h"
#include "train/memory.h"

namespace traceflow::cli {

namespace {

// Names and paths are untrusted.
void row(const std::string& name, const std::string& text) {
  constexpr size_t longest = 4096;
  fmt::print("{:<16}{}\n", name, printable(text, longest));
}

void row(const std::string& name, const Inspection::Split& split) {
  std::string text = fmt::format("{} views", split.views);
  if (split.times == 1) text += fmt::format(", all at the time {:.3f}", split.first_time);
  if (split.times > 1) {
    text += fmt::format(" at {} times from {:.3f} to {:.3f}", split.times, split.first_time, split.last_time);
  }
  const char* between = "; ";
  for (const auto& [count, what] : {std::pair{split.masks, "masks"},
                                    {split.normal_priors, "normal priors"},
                                    {split.depth_priors, "depth priors"},
                                    {split.truth_normals, "true normals"},
                                    {split.truth_depths, "true depths"}}) {
    if (count == 0) continue;
    text += fmt::format("{}{} {}", between, count, what);
    between = ", ";
  }
  row(name, text);
}

std::string box(const Vec3<double>& low, const Vec3<double>& high) {
  return fmt::format("({:.3f} {:.3f} {:.3f}) to ({:.3f} {:.3f} {:.3f})", low.x, low.y, low.z, high.x, high.y,
                     high.z);
}

std::string bytes_text(int64_t bytes) {
  const double mebibytes = static_cast<double>(bytes) / (1 << 20);
  return mebibytes < 1024 ? fmt::format("{:.0f} MiB", mebibytes)
                          : fmt::format("{:.1f} GiB", mebibytes / 1024);
}

void print_images(const Inspection& found) {
  for (const auto& [size, views] : found.sizes)
    row("images", fmt::format("{} of {}×{}", views, size.first, size.second));
  row("", fmt::format("from {}{}{}", found.image_folder,
                      found.box_factor > 1 ? fmt::format(", box-filtered by {}", found.box_factor) : "",
                      found.resampled_views > 0 ? fmt::format(", {} straightened (zoom up to {:.3f})",
                                                              found.resampled_views, found.largest_zoom)
                                                : ""));
}

// PSNR of a perfect render without noise against a noisy image.
double noise_limit_db(double deviation) { return 20 * std::log10(255 / deviation); }

void print_noise(const Inspection::Pixels& pixels) {
  if (!(pixels.noise > 0)) return;
  std::string text = fmt::format("up to {:.1f} of 255 levels: a render without noise has {:.1f} dB",
                                 pixels.noise, noise_limit_db(pixels.noise));
  if (pixels.masked_noise > 0)
    text += fmt::format(", {:.1f} in the masks", noise_limit_db(pixels.masked_noise));
  row("noise", text);
}

void print_geometry(const Capture& capture, const Inspection& found) {
  row("cameras",
      fmt::format("extent {:.3f}, box {}", capture.extent, box(found.camera_low, found.camera_high)));
  row("", fmt::format("turning by up to {:.0f}°, {:.0f}° wide", found.camera_turn_degrees,
                      found.field_of_view_degrees));
  if (capture.far_plane > 0)
    row("depth", fmt::format("{:.3f} to {:.3f}", capture.near_plane, capture.far_plane));
  if (capture.points.empty()) return;
  row("points", fmt::format("{} in {}", capture.points.dim(0), box(found.points_low, found.points_high)));
  row("", fmt::format("a view sees {:.0f}% of them, no view {:.0f}%", 100 * found.sight.in_view,
                      100 * found.sight.unseen));
}

void print_extras(const Capture& capture, const Inspection& found) {
  if (capture.has_masks) {
    row("masks", fmt::format("{}cover {:.1f}% of the pixels",
                             capture.masks_are_estimated ? "estimated, of what moves; " : "",
                             100 * found.pixels.masked));
  }
  if (capture.has_normal_priors) {
    row("normal priors",
        fmt::format("axes {}, on {:.1f}% of the pixels{}", prior_axes_name(capture.prior_axes),
                    100 * found.pixels.with_prior,
                    found.pixels.prior_angle > 0
                        ? fmt::format(", {:.0f}° from planes through the points", found.pixels.prior_angle)
                        : ""));
  }
  if (capture.has_depth_priors) {
    row("depth priors",
        fmt::format("on {:.1f}% of the pixels{}", 100 * found.pixels.with_depth,
                    found.pixels.depth_error > 0
                        ? fmt::format(", {:.1f}% off the points; the scale varies by {:.1f}% between views",
                                      100 * found.pixels.depth_error, 100 * found.pixels.depth_drift)
                        : ""));
  }
  if (!capture.tracks.empty()) {
    const Inspection::Tracks& tracks = found.tracks;
    std::string text = fmt::format("{} points, each seen by {:.0f} of {} views", tracks.points, tracks.views,
                                   capture.train.size());
    if (tracks.consistent) {
      text += fmt::format("; {:.0f}% agree with the cameras{}", 100 * *tracks.consistent,
                          capture.has_masks ? " or lie on masks" : "");
    }
    row("tracks", text);
  }
}

// The texts name at most three views. Paths are listed so that the user can open them, but only a few.
void print_findings(const std::vector<Finding>& findings) {
  constexpr size_t most_files = 5;
  for (const Finding& finding : findings) {
    row(std::string(enum_names(finding.severity)[static_cast<size_t>(finding.severity)]), finding.text);
    for (size_t i = 0; i < std::min(most_files, finding.files.size()); ++i) row("", finding.files[i]);
    if (finding.files.size() > most_files)
      row("", fmt::format("and {} more (--json lists them)", finding.files.size() - most_files));
  }
  if (findings.empty()) row("findings", "none");
}

nlohmann::json to_json(const Vec3<double>& v) { return {v.x, v.y, v.z}; }

nlohmann::json to_json(const Inspection::Split& split) {
  return {{"views", split.views},
          {"masks", split.masks},
          {"normal_priors", split.normal_priors},
          {"depth_priors", split.depth_priors},
          {"truth_normals", split.truth_normals},
          {"truth_depths", split.truth_depths},
          {"times", split.times},
          {"time_range", {split.first_time, split.last_time}}};
}

nlohmann::json to_json(const std::optional<double>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
}

nlohmann::json to_json(const Finding& finding) {
  return {{"severity", enum_names(finding.severity)[static_cast<size_t>(finding.severity)]},
          {"kind", finding.kind},
          {"text", finding.text},
          {"views", finding.views},
          {"files", finding.files},
          {"value", to_json(finding.value)},
          {"threshold", to_json(finding.threshold)}};
}

nlohmann::json images_json(const Inspection& found) {
  nlohmann::json sizes = nlohmann::json::array();
  for (const auto& [size, views] : found.sizes) {
    sizes.push_back({{"width", size.first}, {"height", size.second}, {"views", views}});
  }
  return {{"folder", found.image_folder},
          {"box_factor", found.box_factor},
          {"sizes", sizes},
          {"resampled_views", found.resampled_views},
          {"largest_zoom", found.largest_zoom}};
}

nlohmann::json points_json(const Capture& capture, const Inspection& found) {
  if (capture.points.empty()) return {{"count", 0}};
  return {{"count", capture.points.dim(0)},
          {"box", {to_json(found.points_low), to_json(found.points_high)}},
          {"in_view", found.sight.in_view},
          {"unseen", found.sight.unseen},
          {"behind", found.sight.behind}};
}

nlohmann::json tracks_json(const Inspection::Tracks& tracks) {
  if (tracks.points == 0) return nullptr;
  return {{"points", tracks.points},
          {"views_per_point", tracks.views},
          {"consistent", to_json(tracks.consistent)},
          {"compared_off_masks", tracks.compared},
          {"agreeing_off_masks", to_json(tracks.agreeing)}};
}

nlohmann::json decoded_json(const Inspection::Pixels& pixels) {
  return {{"views", pixels.views},
          {"mean_colour", pixels.mean_colour},
          {"masked", pixels.masked},
          {"with_prior", pixels.with_prior},
          {"noise", pixels.noise > 0 ? nlohmann::json(pixels.noise / 255) : nullptr},
          {"masked_noise", pixels.masked_noise > 0 ? nlohmann::json(pixels.masked_noise / 255) : nullptr},
          {"prior_angle_degrees", pixels.prior_angle > 0 ? nlohmann::json(pixels.prior_angle) : nullptr},
          {"with_depth", pixels.with_depth},
          {"depth_error", pixels.depth_error > 0 ? nlohmann::json(pixels.depth_error) : nullptr},
          {"depth_drift", pixels.depth_error > 0 ? nlohmann::json(pixels.depth_drift) : nullptr}};
}

}  // namespace

MemoryNeeds memory_needs(const Capture& capture, const TrainOptions& options, Inspection& inspection) {
  MemorySetting run = memory_setting(options, Device::cpu, capture);
  MemoryNeeds needs;
  needs.kept_images = std::min(inspection.decoded_bytes, capture.images->limit_bytes());
  needs.on_cpu = unlimited_forecast(run);
  needs.available = memory_available();
  try {
    plan_memory(run);
  } catch (const InputError& error) {
    inspection.findings.insert(inspection.findings.begin(), Finding(error.what(), "memory"));
  }
  run.device = Device::cuda;
  needs.on_cuda = unlimited_forecast(run);
  return needs;
}

void print_report(const Capture& capture, const Inspection& found, const MemoryNeeds& memory) {
  row("capture", fmt::format("{} ({})", capture.name, capture.format));
  row("train", found.train);
  row("test", found.test);
  print_images(found);
  print_noise(found.pixels);
  print_geometry(capture, found);
  print_extras(capture, found);
  row("memory", fmt::format("{} of decoded images, {} of them kept", bytes_text(found.decoded_bytes),
                            bytes_text(memory.kept_images)));
  row("", fmt::format("training takes up to {} on the CPU ({} are free), {} on CUDA",
                      bytes_text(memory.on_cpu), bytes_text(memory.available), bytes_text(memory.on_cuda)));
  for (const std::string& text : found.missing) row("missing", text);
  print_findings(found.findings);
}

nlohmann::json report_json(const Capture& capture, const Inspection& found, const MemoryNeeds& memory) {
  nlohmann::json findings = nlohmann::json::array();
  for (const Finding& finding : found.findings) findings.push_back(to_json(finding));
  return {{"name", capture.name},
          {"format", capture.format},
          {"train", to_json(found.train)},
          {"test", to_json(found.test)},
          {"images", images_json(found)},
          {"cameras",
           {{"extent", capture.extent},
            {"box", {to_json(found.camera_low), to_json(found.camera_high)}},
            {"turn_degrees", found.camera_turn_degrees},
            {"field_of_view_degrees", found.field_of_view_degrees},
            {"near", capture.near_plane},
            {"far", capture.far_plane}}},
          {"normalisation",
           {{"centre", to_json(capture.normalisation.centre)}, {"scale", capture.normalisation.scale}}},
          {"points", points_json(capture, found)},
          {"masks_estimated", capture.masks_are_estimated},
          {"prior_axes",
           capture.has_normal_priors ? nlohmann::json(prior_axes_name(capture.prior_axes)) : nullptr},
          {"tracked_points", capture.tracks.count()},
          {"tracks", tracks_json(found.tracks)},
          {"decoded", decoded_json(found.pixels)},
          {"memory",
           {{"decoded_bytes", found.decoded_bytes},
            {"kept_image_bytes", memory.kept_images},
            {"training_cpu_bytes", memory.on_cpu},
            {"training_cuda_bytes", memory.on_cuda},
            {"available_bytes", memory.available}}},
          {"missing", found.missing},
          {"findings", findings}};
}

}  // namespace traceflow::cli
