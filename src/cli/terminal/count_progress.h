#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>

namespace traceflow::cli {

// A count out of a total: "12/120 frames", "features  12/87". all is 0 if unknown.
struct Count {
  std::string label, unit;
  int64_t done = 0, all = 0;
};
// Adds the rate and the remaining time, after `seconds` of counting: "12/120 frames  4.0 a second  27 s
// left".
std::string count_line(const Count& count, double seconds);

// Shows the progress of counted work. On a terminal it redraws one line; elsewhere it writes a line every
// fifteen seconds. It has no clock: the caller passes the time.
class CountProgress {
 public:
  // width: columns of the terminal, 0 if there is none.
  CountProgress(std::ostream& out, int width) : out_(&out), width_(width) {}
  ~CountProgress() { finish(); }
  CountProgress(const CountProgress&) = delete;
  CountProgress& operator=(const CountProgress&) = delete;
  // Writes to standard error, with the width of its terminal.
  static CountProgress for_stderr();

  // seconds: since the start of this count. A smaller value than before starts a new count.
  void show(const Count& count, double seconds);
  // Clears the redrawn line.
  void finish();

 private:
  std::ostream* out_;
  int width_;
  bool line_is_open_ = false;
  double shown_at_ = 0;
};

}  // namespace traceflow::cli
