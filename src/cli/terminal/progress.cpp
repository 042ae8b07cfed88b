#include "cli/terminal/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <vector>

namespace traceflow::cli {

namespace {

constexpr int bar_cells = 20;
constexpr int64_t line_percent = 5;

int64_t percent_of(const events::Step& step) {
  return step.iterations > 0 ? 100 * step.iteration / step.iterations : 100;
}

std::string bar(const events::Step& step) {
  const double share =
      step.iterations > 0 ? static_cast<double>(step.iteration) / static_cast<double>(step.iterations) : 1;
  const int done = static_cast<int>(std::lround(std::clamp(share, 0.0, 1.0) * bar_cells));
  return "[" + std::string(static_cast<size_t>(done), '=') +
         std::string(static_cast<size_t>(bar_cells - done), ' ') + "]";
}

std::string surfel_text(const events::SurfelCounts& counts) {
  if (counts.environment == 0) return count_text(counts.main) + " surfels";
  return count_text(counts.main) + "+" + count_text(counts.environment) + " surfels";
}

const char* ending_text(events::Ending ending) {
  switch (ending) {
    case events::Ending::completed:
      return "done";
    case events::Ending::interrupted:
      return "interrupted";
    case events::Ending::diverged:
      return "diverged";
    case events::Ending::out_of_memory:
      return "ended for want of memory";
    case events::Ending::no_input:
      return "ended for want of the capture";
  }
  return "ended";
}

}  // namespace

int terminal_width() {
  if (isatty(STDERR_FILENO) == 0) return 0;
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

std::string duration_text(double seconds) {
  if (!std::isfinite(seconds) || seconds < 0) return "?";
  const auto whole = std::llround(std::min(seconds, 1e9));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{}:{:02}", whole / 60, whole % 60);
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

std::string count_text(int64_t count) {
  const auto number = static_cast<double>(count);
  if (count < 1000) return fmt::format("{}", count);
  if (count < 999'950) return fmt::format("{:.1f}k", number * 1e-3);
  return fmt::format("{:.2f}M", number * 1e-6);
}

std::string status_line(const events::Step& step, int width) {
  const auto left = static_cast<double>(step.iterations - step.iteration) / step.rate;
  std::vector<std::string> parts;
  if (width > 0) parts.push_back(bar(step));
  parts.insert(parts.end(), {fmt::format("{:>3}%", percent_of(step)),
                             step.rate > 0 ? duration_text(left) + " left" : "? left", step.phase,
                             fmt::format("PSNR {:.2f}", step.psnr), fmt::format("loss {:.4f}", step.loss),
                             fmt::format("{}/{}", step.iteration, step.iterations),
                             fmt::format("{:.3g} it/s", step.rate), surfel_text(step.surfels)});
  std::string line;
  for (const std::string& part : parts) {
    if (width > 0 && line.size() + 2 + part.size() >= static_cast<size_t>(width)) break;
    if (!line.empty()) line += "  ";
    line += part;
  }
  return line;
}

events::Listener warnings_alone(std::ostream& out) {
  return [progress = Progress(out, 0)](const events::Event& event) mutable {
    if (std::holds_alternative<events::Warning>(event)) progress(event);
  };
}

Progress::Progress(std::ostream& out, int width) : out_(&out), width_(width) {}

Progress Progress::for_stderr() { return {std::cerr, terminal_width()}; }

void Progress::operator()(const events::Event& event) {
  std::visit([this](const auto& e) { show(e); }, event);
}

void Progress::print_line(const std::string& text) {
  if (line_is_open_) *out_ << "\r\x1b[K";
  line_is_open_ = false;
  *out_ << text << std::endl;
}

void Progress::show(const events::Started& e) {
  const std::string threads = fmt::format("{} thread{}", e.threads, e.threads == 1 ? "" : "s");
  print_line(fmt::format("{}: {} iterations{} on {}, {}, at most {} MiB -> {}", e.capture, e.iterations,
                         e.iteration > 0 ? fmt::format(" from {}", e.iteration) : "",
                         e.device == "cpu" ? threads : e.device, surfel_text(e.surfels),
                         (e.forecast_bytes + (1 << 20) - 1) >> 20, e.run.string()));
  if (e.iteration == 0 && e.points_in_view > 0 && e.points_in_view < e.points) {
    print_line(fmt::format("main surfels start at the {} of {} points that training views see",
                           e.points_in_view, e.points));
  }
}

void Progress::show(const events::Step& e) {
  const bool last = e.iteration >= e.iterations;
  if (width_ > 0) {
    if (!last && e.seconds - shown_at_ < redraw_seconds) return;
    *out_ << "\r\x1b[K" << status_line(e, width_) << std::flush;
    line_is_open_ = true;
  } else {
    const bool due = percent_of(e) - shown_percent_ >= line_percent || e.seconds - shown_at_ >= line_seconds;
    if (!last && !due) return;
    *out_ << status_line(e, 0) << std::endl;
  }
  shown_at_ = e.seconds;
  shown_percent_ = percent_of(e);
}

// The status line shows the counts; a warning reports a limit on growth.
void Progress::show(const events::DensityChanged&) {}
void Progress::show(const events::FollowingDecided&) {}
void Progress::show(const events::BodiesParted&) {}
void Progress::show(const events::BendingDecided&) {}
void Progress::show(const events::PriorsTurned&) {}

void Progress::show(const events::PhaseEntered& e) {
  print_line(fmt::format("phase {} from iteration {}", e.phase, e.iteration));
}

void Progress::show(const events::Evaluated& e) {
  print_line(fmt::format("iteration {}: PSNR {:.2f} dB, SSIM {:.4f} over {} {} views", e.iteration, e.psnr,
                         e.ssim, e.views, e.split));
}

void Progress::show(const events::Warning& e) { print_line("warning: " + e.text); }

void Progress::show(const events::Paused& e) {
  print_line(e.paused ? fmt::format("paused by the viewer at iteration {}", e.iteration) : "going on");
}

void Progress::show(const events::Saved& e) {
  print_line(fmt::format("saved {} at iteration {}", e.path.string(), e.iteration));
}

// Only for the log.
void Progress::show(const events::Measured&) {}

void Progress::show(const events::Finished& e) {
  print_line(fmt::format("{} after {} iterations and {}: PSNR {:.2f} dB over the last views, {}{}",
                         ending_text(e.ending), e.iteration, duration_text(e.seconds), e.psnr,
                         surfel_text(e.surfels), e.reason.empty() ? "" : "; " + e.reason));
}

}  // namespace traceflow::cli
