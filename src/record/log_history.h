#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "base/profile.h"

// Reads a run's log.jsonl, for the report and for clients that start to watch a running training.
namespace traceflow {

// An event, as a line of JSON.
struct LoggedEvent {
  std::string kind;  // "step", "saved", …
  int64_t iteration = 0;
  std::string line;  // without newline
};

// Returns nothing if the line cannot be read.
std::optional<LoggedEvent> read_event(const std::string& line);

// A line of a log as it is in the file.
struct LogLine {
  std::string text;    // without newline; empty if longer than any event
  int64_t bytes = 0;   // 0: no line is left
  bool ended = false;  // else it is the last line, perhaps incomplete
};
LogLine next_line(std::istream& log);

// How much of a log has been read. Training writes far less than the limit, but a folder from elsewhere may
// have any file in place of the log.
struct LogExtent {
  int64_t bytes = 0, events = 0;
  bool is_all() const { return bytes >= int64_t{256} << 20 || events >= 200'000; }
};

// Opens a log for reading. The stream is closed if there is none, or if the path is not a file.
std::ifstream open_events(const std::filesystem::path& path);

// The valid events among all logged ones, in order: see read_log.
std::vector<LoggedEvent> that_count(std::vector<LoggedEvent> logged);

// The valid events, in order. A log may contain several sessions. A resumed session returns to its
// checkpoint, so events after the checkpoint are dropped. The endings of sessions that were resumed and
// repeated warnings are dropped too. Lines that cannot be read, such as an incomplete one, are left out, and
// so is everything beyond the limit of LogExtent.
std::vector<LoggedEvent> read_log(std::istream& log);
// Reads a file. Returns nothing if there is none.
std::vector<LoggedEvent> read_log(const std::filesystem::path& path);

// The events with at most `steps` (2 or more) of the kind "step", evenly spaced, including the first and the
// last.
std::vector<LoggedEvent> thinned(const std::vector<LoggedEvent>& events, size_t steps = 2000);

std::vector<std::string> lines_of(const std::vector<LoggedEvent>& events);

// A phase of a run, from its log.
struct LoggedPhase {
  std::string name;
  int64_t first = 0, last = 0;  // iterations, counted from 1
  double seconds = 0;           // of training
  std::vector<profile::Entry>
      steps;  // durations, longest first; scaled up to all iterations if only some were measured
};

// `events`: from read_log, before thinning.
std::vector<LoggedPhase> phases_of(const std::vector<LoggedEvent>& events);

}  // namespace traceflow
