#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "base/profile.h"

// What a run's log.jsonl tells of it afterwards, for the report and for those who begin to watch a run that
// is under way.
namespace traceflow {

// An event, as a line of JSON.
struct LoggedEvent {
  std::string kind;  // "step", "saved", …
  int64_t iteration = 0;
  std::string line;  // without its end
};

// Nothing for a line that cannot be read.
std::optional<LoggedEvent> read_event(const std::string& line);

// Of all events that were logged, those that count, in order: see read_log.
std::vector<LoggedEvent> that_count(std::vector<LoggedEvent> logged);

// The events that count, in order. A log may hold several sessions: a resumed one goes back to its
// checkpoint, and what came after that is dropped, as are the endings of sessions that were continued and
// warnings said before. Lines that cannot be read, such as one that is half written, are left out.
std::vector<LoggedEvent> read_log(std::istream& log);
// Of a file; nothing where there is none.
std::vector<LoggedEvent> read_log(const std::filesystem::path& path);

// The events with at most `steps` (2 or more) of the kind "step", spread evenly, first and last among them.
std::vector<LoggedEvent> thinned(const std::vector<LoggedEvent>& events, size_t steps = 2000);

// Their lines.
std::vector<std::string> lines_of(const std::vector<LoggedEvent>& events);

// A phase of a run as its log tells it.
struct LoggedPhase {
  std::string name;
  int64_t first = 0, last = 0;  // iterations, counted from 1
  double seconds = 0;           // of training
  std::vector<profile::Entry>
      steps;  // where the time went, most first; scaled up where some iterations were measured
};

// Of the events that read_log returned, before they are thinned.
std::vector<LoggedPhase> phases_of(const std::vector<LoggedEvent>& events);

}  // namespace traceflow
