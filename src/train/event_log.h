#pragma once

#include <filesystem>
#include <fstream>

#include "train/events.h"

namespace traceflow {

// A listener that writes each event as one line of JSON: {"event": "step", "iteration": …}. Appends, so that
// a resumed run goes on in the same file. Every line is flushed: `tail -f` follows a run, and a killed one
// loses nothing. Numbers that are not finite become null.
class EventLog {
 public:
  // Throws InputError when the file cannot be opened. Of the Step events, only those of every
  // `step_interval`-th iteration and the last are written.
  explicit EventLog(const std::filesystem::path& path, int64_t step_interval = 1);

  void operator()(const events::Event& event);

 private:
  std::ofstream file_;
  int64_t step_interval_;
};

// The line, without its end.
std::string to_json_line(const events::Event& event);

}  // namespace traceflow
