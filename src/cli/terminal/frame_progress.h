#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>

namespace traceflow::cli {

// Shows a person how far a film has come. On a terminal one line is redrawn; elsewhere a line is written
// every fifteen seconds. It keeps no clock of its own.
class FrameProgress {
 public:
  // width: columns of the terminal, 0 where there is none.
  FrameProgress(std::ostream& out, int width, int64_t frames) : out_(&out), width_(width), frames_(frames) {}
  // To standard error, as wide as its terminal is.
  static FrameProgress for_stderr(int64_t frames);

  // After `done` frames and `seconds` since the beginning.
  void show(int64_t done, double seconds);
  // Clears the redrawn line.
  void finish();

 private:
  std::ostream* out_;
  int width_;
  int64_t frames_;
  bool line_is_open_ = false;
  double shown_at_ = 0;
};

// "12/120 frames  4.0 a second  27 s left".
std::string frame_line(int64_t done, int64_t frames, double seconds);

}  // namespace traceflow::cli
