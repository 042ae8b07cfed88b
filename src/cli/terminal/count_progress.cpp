#include "cli/terminal/count_progress.h"

#include <fmt/format.h>

#include <iostream>

#include "cli/terminal/progress.h"

namespace traceflow::cli {

std::string count_line(const Count& count, double seconds) {
  std::string line = count.label.empty() ? "" : fmt::format("{:<10}", count.label);
  line += count.all > 0    ? fmt::format("{}/{}", count.done, count.all)
          : count.done > 0 ? fmt::format("{}", count.done)
                           : "…";
  if (!count.unit.empty()) line += " " + count.unit;
  if (count.done <= 0 || !(seconds > 0)) return line;
  const double rate = static_cast<double>(count.done) / seconds;
  line += fmt::format("  {:.3g} a second", rate);
  if (count.all <= 0) return line;
  return line + fmt::format("  {} left", duration_text(static_cast<double>(count.all - count.done) / rate));
}

CountProgress CountProgress::for_stderr() { return {std::cerr, terminal_width()}; }

void CountProgress::show(const Count& count, double seconds) {
  if (seconds < shown_at_) shown_at_ = 0;
  const bool begins_on_terminal = width_ > 0 && count.done == 0;
  if (!begins_on_terminal && seconds - shown_at_ < (width_ > 0 ? redraw_seconds : line_seconds)) return;
  shown_at_ = seconds;
  const std::string line = count_line(count, seconds);
  if (width_ > 0) {
    *out_ << "\r\x1b[K" << line.substr(0, static_cast<size_t>(width_ - 1)) << std::flush;
    line_is_open_ = true;
  } else {
    *out_ << line << std::endl;
  }
}

void CountProgress::finish() {
  if (line_is_open_) *out_ << "\r\x1b[K" << std::flush;
  line_is_open_ = false;
}

}  // namespace traceflow::cli
