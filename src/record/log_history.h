#pragma once

#include <cstdint>
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

// A line of a log as it stands there.
struct LogLine {
  std::string text;    // without its end; empty where it is longer than an event may be
  int64_t bytes = 0;   // 0: there is none left
  bool ended = false;  // else it is the last one, perhaps half written
};
LogLine next_line(std::istream& log);

// How far a log has been read. Training writes a small part of what is read at most; a folder from elsewhere
// may hold any file in the log's place.
struct LogExtent {
  int64_t bytes = 0, events = 0;
  bool is_all() const { return bytes >= int64_t{256} << 20 || events >= 200'000; }
};

// A log to read; closed where there is none, or something that is no file.
std::ifstream open_events(const std::filesystem::path& path);

// Of all events that were logged, those that count, in order: see read_log.
std::vector<LoggedEvent> that_count(std::vector<LoggedEvent> logged);

// The events that count, in order. A log may hold several sessions: a resumed one goes back to its
// checkpoint, and what came after that is dropped, as are the endings of sessions that were continued and
// warnings said before. Lines that cannot be read, such as one that is half written, are left out, as is what
// comes after the LogExtent that is all.
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
