#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>

namespace traceflow::cli {

// What is counted, of how many: "12/120 frames", "features  12/87". all is 0 where it is not known.
struct Count {
  std::string label, unit;
  int64_t done = 0, all = 0;
};
// With the rate and the time that is left, after `seconds` of counting: "12/120 frames  4.0 a second  27 s
// left".
std::string count_line(const Count& count, double seconds);

// Shows a person how far counted work has come. On a terminal one line is redrawn; elsewhere a line is
// written every fifteen seconds. It keeps no clock of its own.
class CountProgress {
 public:
  // width: columns of the terminal, 0 where there is none.
  CountProgress(std::ostream& out, int width) : out_(&out), width_(width) {}
  ~CountProgress() { finish(); }
  CountProgress(const CountProgress&) = delete;
  CountProgress& operator=(const CountProgress&) = delete;
  // To standard error, as wide as its terminal is.
  static CountProgress for_stderr();

  // seconds: since this was begun to count. Fewer than before are those of another count.
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
