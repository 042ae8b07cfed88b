#pragma once

#include <functional>
#include <iosfwd>
#include <string>

#include "record/events.h"

namespace traceflow::cli {

// How often a line is drawn again on a terminal, and a new one written elsewhere.
constexpr double redraw_seconds = 0.1;
constexpr double line_seconds = 15;

// A listener that shows a run to a person. On a terminal one line is redrawn; elsewhere a line is written
// every five percent or fifteen seconds. It keeps no clock of its own: time is what the events say.
class Progress {
 public:
  // width: columns of the terminal, 0 where there is none.
  Progress(std::ostream& out, int width);
  // To standard error, as wide as its terminal is.
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
  // A line of its own, above the redrawn one.
  void print_line(const std::string& text);

  std::ostream* out_;
  int width_;
  bool line_is_open_ = false;
  double shown_at_ = -1e9;  // seconds of training
  int64_t shown_percent_ = -100;
};

// A listener that shows of a run its warnings alone.
events::Listener warnings_alone(std::ostream& out);

// The status line of one step, made of as many of its parts as fit into `width` columns (0: all, and no bar).
std::string status_line(const events::Step& step, int width);

// Columns of standard error's terminal; 0 where it is none.
int terminal_width();

// 7 s, 2:05, 1:02:03.
std::string duration_text(double seconds);
// 950, 12.7k, 1.25M.
std::string count_text(int64_t count);

}  // namespace traceflow::cli
