#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "record/events.h"

namespace traceflow {

// A listener that writes each event as one line of JSON: {"event": "step", "iteration": …}. Appends, so that
// a resumed run goes on in the same file; half a line, which a killed run may have left at the end, is cut
// off. Every line is written at once: `tail -f` follows a run, and a killed one loses nothing. Numbers that
// are not finite become null. Lines that the disk refuses do not end a training; how many are missing is
// logged when it takes lines again.
class EventLog {
 public:
  // Throws InputError when the file cannot be opened. Of the Step events, only those of every
  // `step_interval`-th iteration and the last are written.
  explicit EventLog(const std::filesystem::path& path, int64_t step_interval = 1);
  ~EventLog();
  EventLog(const EventLog&) = delete;
  EventLog& operator=(const EventLog&) = delete;

  void operator()(const events::Event& event);

 private:
  // Whether the whole line stands; nothing of it does where not.
  bool write(const std::string& line);

  int descriptor_;
  int64_t step_interval_;
  int64_t missing_ = 0;  // lines
};

// The line, without its end.
std::string to_json_line(const events::Event& event);

}  // namespace traceflow
