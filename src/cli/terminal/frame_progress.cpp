#include "cli/terminal/frame_progress.h"

#include <fmt/format.h>

#include <iostream>

#include "cli/terminal/progress.h"

namespace traceflow::cli {

std::string frame_line(int64_t done, int64_t frames, double seconds) {
  std::string count = fmt::format("{}/{} frames", done, frames);
  if (done <= 0 || !(seconds > 0)) return count;
  const double rate = static_cast<double>(done) / seconds;
  return fmt::format("{}  {:.3g} a second  {} left", count, rate,
                     duration_text(static_cast<double>(frames - done) / rate));
}

FrameProgress FrameProgress::for_stderr(int64_t frames) { return {std::cerr, terminal_width(), frames}; }

void FrameProgress::show(int64_t done, double seconds) {
  if (seconds - shown_at_ < (width_ > 0 ? redraw_seconds : line_seconds)) return;
  shown_at_ = seconds;
  const std::string line = frame_line(done, frames_, seconds);
  if (width_ > 0) {
    *out_ << "\r\x1b[K" << line.substr(0, static_cast<size_t>(width_ - 1)) << std::flush;
    line_is_open_ = true;
  } else {
    *out_ << line << std::endl;
  }
}

void FrameProgress::finish() {
  if (line_is_open_) *out_ << "\r\x1b[K" << std::flush;
  line_is_open_ = false;
}

}  // namespace traceflow::cli
