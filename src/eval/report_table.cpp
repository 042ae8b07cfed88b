#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "eval/report.h"

namespace traceflow::eval {

namespace {

struct Column {
  const char* head;
  std::optional<double> Metrics::*figure;
  int decimals;
  double factor = 1;
};

// Depth errors appear only as medians; metrics.json also has the means.
constexpr std::array<Column, 12> columns = {{
    {"PSNR", &Metrics::psnr, 2},
    {"SSIM", &Metrics::ssim, 4},
    {"LPIPS", &Metrics::lpips, 4},
    {"LPIPS-pub", &Metrics::lpips_published, 4},
    {"mPSNR", &Metrics::masked_psnr, 2},
    {"mSSIM", &Metrics::masked_ssim, 4},
    {"cPSNR", &Metrics::core_psnr, 2},
    {"normal°", &Metrics::normal_mae_deg, 2},
    {"mnormal°", &Metrics::masked_normal_mae_deg, 2},
    {"mdepth%", &Metrics::masked_depth_error_median, 2, 100},
    {"cdepth%", &Metrics::core_depth_error_median, 2, 100},
    {"odepth%", &Metrics::outside_depth_error_median, 2, 100},
}};

// A dash for a metric that is not available.
std::string table_line(const std::string& label, size_t width, const std::vector<Column>& shown,
                       const Metrics& m) {
  std::string line = fmt::format("{:<{}}", label, width);
  for (const Column& c : shown) {
    const std::optional<double>& value = m.*c.figure;
    line += value ? fmt::format("{:>10.{}f}", c.factor * *value, c.decimals) : fmt::format("{:>10}", "-");
  }
  return line + "\n";
}

// A line for each object, and the mean.
std::string motion_text(const MotionReport& report) {
  const auto figures = [](const MotionFigures& f) {
    return fmt::format(
        "moves {:.3f}, missed by {:.3f} ({}), rotation off by {:.1f}°, scale {:.2f} (true {:.2f})",
        f.moved.value_or(0), f.missed.value_or(0), f.share ? fmt::format("{:.2f}", *f.share) : "-",
        f.rotation_error_deg.value_or(0), f.scale.value_or(1), f.true_scale.value_or(1));
  };
  std::string text = "motion, in capture units; in brackets missed by moved, 1 = not followed\n";
  for (const ObjectMotion& o : report.objects) {
    text += fmt::format("  object {}: {} of {} points have surfels", o.object, o.followed_points, o.points) +
            (o.figures.missed ? ": " + figures(o.figures) : ": not followed") + "\n";
  }
  return report.mean.missed ? text + "  mean: " + figures(report.mean) + "\n" : text;
}

}  // namespace

std::string report_table(const Report& report) {
  const Metrics mean = mean_of(report);
  std::vector<Column> shown;
  std::ranges::copy_if(columns, std::back_inserter(shown),
                       [&](const Column& c) { return (mean.*c.figure).has_value(); });
  size_t width = report.aligned ? 8 : 6;
  for (const ViewReport& view : report.views) width = std::max(width, view.id.size() + 1);
  std::string text = fmt::format("{:<{}}", "view", width);
  for (const Column& c : shown) text += fmt::format("{:>10}", c.head);
  text += "\n";
  for (const ViewReport& view : report.views) text += table_line(view.id, width, shown, view.metrics);
  text += table_line("mean", width, shown, mean);
  if (report.aligned) text += table_line("aligned", width, shown, *report.aligned);
  return report.motion ? text + motion_text(*report.motion) : text;
}

}  // namespace traceflow::eval
