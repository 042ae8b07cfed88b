#pragma once

#include <functional>
#include <iosfwd>
#include <string>

#include "record/events.h"

namespace traceflow::cli {

// Interval of redrawing on a terminal, and of new lines elsewhere.
constexpr double redraw_seconds = 0.1;
constexpr double line_seconds = 15;

// A listener that shows the progress of a run. On a terminal it redraws one line; elsewhere it writes a line
// every five percent or fifteen seconds. It has no clock: events carry the time.
class Progress {
 public:
  // width: columns of the terminal, 0 if there is none.
  Progress(std::ostream& out, int width);
  // Writes to standard error, with the width of its terminal.
  static Progress for_stderr();

  void operator()(const events::Event& event);

 private:
  void show(const events::Started& e);
  void show(const events::Step& e);
  void show(const events::DensityChanged& e);
  void show(const events::FollowingDecided& e);
  void show(const events::BodiesParted& e);
  void show(const events::BendingDecided& e);
  void show(const events::PriorsTurned& e);
  void show(const events::PhaseEntered& e);
  void show(const events::Evaluated& e);
  void show(const events::Warning& e);
  void show(const events::Paused& e);
  void show(const events::Saved& e);
  void show(const events::Measured& e);
  void show(const events::Finished& e);
  // Prints a separate line above the redrawn one.
  void print_line(const std::string& text);

  std::ostream* out_;
  int width_;
  bool line_is_open_ = false;
  double shown_at_ = -1e9;  // seconds of training
  int64_t shown_percent_ = -100;
};

// A listener that only shows the run's warnings.
events::Listener warnings_alone(std::ostream& out);

// The status line of one step, with as many parts as fit into `width` columns (0: all parts, no bar).
std::string status_line(const events::Step& step, int width);

// Columns of standard error's terminal; 0 if it is not a terminal.
int terminal_width();

// 7 s, 2:05, 1:02:03.
std::string duration_text(double seconds);
// 950, 12.7k, 1.25M.
std::string count_text(int64_t count);

}  // namespace traceflow::cli
