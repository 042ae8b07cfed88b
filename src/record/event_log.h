#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "record/events.h"

namespace traceflow {

// A listener that writes each event as one line of JSON: {"event": "step", "iteration": …}. It appends, so
// that a resumed run continues in the same file. An incomplete last line, which a killed run may have left,
// is cut off. Each line is written at once, so `tail -f` follows a run and a killed run loses nothing.
// Numbers that are not finite become null. Training continues if the disk refuses lines; the number of
// missing lines is logged when the disk accepts lines again.
class EventLog {
 public:
  // Throws InputError when the file cannot be opened. Only Step events of every `step_interval`-th iteration
  // and of the last one are written.
  explicit EventLog(const std::filesystem::path& path, int64_t step_interval = 1);
  ~EventLog();
  EventLog(const EventLog&) = delete;
  EventLog& operator=(const EventLog&) = delete;

  void operator()(const events::Event& event);

 private:
  // Returns whether the whole line was written. If not, no part of it remains in the file.
  bool write(const std::string& line);

  int descriptor_;
  int64_t step_interval_;
  int64_t missing_ = 0;  // lines
};

// The line without its newline.
std::string to_json_line(const events::Event& event);

}  // namespace traceflow
