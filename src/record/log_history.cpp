#include "record/log_history.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <system_error>

#include "files/json_document.h"

namespace traceflow {

namespace {

using Json = nlohmann::ordered_json;

// Larger, deeper or with more values than any event, so not written by this program.
constexpr size_t line_cap = size_t{1} << 20;
constexpr int depth_cap = 8;
constexpr size_t value_cap = 4000;
// Beyond any run, but small enough that sums over a whole log do not overflow.
constexpr int64_t iteration_cap = int64_t{1} << 53;
constexpr double call_cap = 1e11;

// Returns an object, or null.
Json parsed(const std::string& line) {
  const auto shallow = [](int depth, Json::parse_event_t, Json&) { return depth <= depth_cap; };
  const bool is_ours = line.size() <= line_cap && json_extent(line).values <= value_cap;
  Json json = is_ours ? Json::parse(line, shallow, false) : Json();
  return json.is_object() ? std::move(json) : Json();
}

std::string text_in(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

double number_in(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : 0;
}

// Whether an iteration emits this event at its start, with the number of iterations done before it.
bool is_told_first(const std::string& kind) {
  static const std::set<std::string> kinds{"phase_entered", "following_decided", "bodies_parted",
                                           "priors_turned", "bending_decided"};
  return kinds.contains(kind);
}

// The events so far. A later line may remove some of them.
class History {
 public:
  void add(LoggedEvent event) {
    if (event.kind == "started") {
      go_back_to(event.iteration);
    } else if (event.kind == "step") {
      // The iterations go back although no start was read.
      if (event.iteration <= last_step_) go_back_to(event.iteration - 1);
      last_step_ = event.iteration;
    }
    events_.push_back(std::move(event));
  }
  std::vector<LoggedEvent> take() {
    std::set<std::string> warnings;
    std::erase_if(events_, [&](const LoggedEvent& e) {
      return e.kind == "warning" && !warnings.insert(text_in(parsed(e.line), "text")).second;
    });
    return std::move(events_);
  }

 private:
  // Goes back to `done` iterations. The events that the next iteration emits at its start will be emitted
  // again.
  void go_back_to(int64_t done) {
    if (done <= 0) events_.clear();
    std::erase_if(events_, [&](const LoggedEvent& e) {
      return e.iteration > done || e.kind == "finished" || (e.iteration == done && is_told_first(e.kind));
    });
    last_step_ = done;
  }

  std::vector<LoggedEvent> events_;
  int64_t last_step_ = 0;
};

// Adds the steps of a "measured" event, scaled as if all `iterations` had been measured.
void add_measured(const Json& json, double iterations, std::vector<profile::Entry>& sums) {
  const double measured = number_in(json, "iterations");
  const auto steps = json.find("steps");
  if (!(measured >= 1) || steps == json.end() || !steps->is_array()) return;
  const double share = std::max(1.0, iterations / measured);
  for (const Json& step : *steps) {
    const std::string name = step.is_object() ? text_in(step, "name") : std::string();
    const double calls = name.empty() ? 0 : number_in(step, "calls");
    if (!(calls >= 0 && share * calls < call_cap)) continue;
    auto sum =
        std::find_if(sums.begin(), sums.end(), [&](const profile::Entry& e) { return e.name == name; });
    if (sum == sums.end()) sum = sums.insert(sums.end(), {name, 0, 0});
    sum->calls += std::llround(share * calls);
    sum->seconds += share * number_in(step, "seconds");
  }
}

}  // namespace

std::optional<LoggedEvent> read_event(const std::string& line) {
  const Json json = parsed(line);
  const auto iteration = json.is_object() ? json.find("iteration") : json.end();
  if (iteration == json.end() || !iteration->is_number_integer()) return std::nullopt;
  LoggedEvent event{text_in(json, "event"), iteration->get<int64_t>(), json.dump()};
  if (event.kind.empty() || event.iteration < 0 || event.iteration > iteration_cap) return std::nullopt;
  return event;
}

std::vector<LoggedEvent> that_count(std::vector<LoggedEvent> logged) {
  History history;
  for (LoggedEvent& event : logged) history.add(std::move(event));
  return history.take();
}

LogLine next_line(std::istream& log) {
  LogLine line;
  std::array<char, 4096> piece{};
  do {
    log.clear();  // getline sets failbit when a piece is full
    log.getline(piece.data(), piece.size());
    line.ended = log.good();
    line.bytes += log.gcount();
    if (line.text.size() <= line_cap)
      line.text.append(piece.data(), static_cast<size_t>(log.gcount() - (line.ended ? 1 : 0)));
  } while (!line.ended && !log.eof() && !log.bad() && !LogExtent{line.bytes}.is_all());
  if (line.text.size() > line_cap) line.text.clear();
  return line;
}

std::ifstream open_events(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return {};
  return std::ifstream(path, std::ios::binary);
}

std::vector<LoggedEvent> read_log(std::istream& log) {
  std::vector<LoggedEvent> logged;
  LogExtent read;
  while (!read.is_all()) {
    const LogLine line = next_line(log);
    if (line.bytes == 0) break;
    read.bytes += line.bytes;
    auto event = read_event(line.text);
    if (!event) continue;
    ++read.events;
    logged.push_back(std::move(*event));
  }
  return that_count(std::move(logged));
}

std::vector<LoggedEvent> read_log(const std::filesystem::path& path) {
  std::ifstream file = open_events(path);
  return read_log(file);
}

std::vector<LoggedEvent> thinned(const std::vector<LoggedEvent>& events, size_t steps) {
  const auto count = static_cast<size_t>(
      std::count_if(events.begin(), events.end(), [](const LoggedEvent& e) { return e.kind == "step"; }));
  if (count <= steps || steps < 2) return events;
  std::vector<LoggedEvent> kept;
  size_t step = 0, next = 0;
  for (const LoggedEvent& event : events) {
    if (event.kind == "step") {
      // The kept step number `next` is the one at next·(count − 1)/(steps − 1).
      if (step++ != next * (count - 1) / (steps - 1)) continue;
      ++next;
    }
    kept.push_back(event);
  }
  return kept;
}

std::vector<LoggedPhase> phases_of(const std::vector<LoggedEvent>& events) {
  std::vector<LoggedPhase> phases;
  // The training time and the iterations that are already assigned to phases.
  double seconds = 0;
  int64_t measured_to = 0;
  const auto phase = [&](const std::string& name, int64_t first) -> LoggedPhase& {
    if (phases.empty() || phases.back().name != name) phases.push_back({name, first, first - 1, 0, {}});
    return phases.back();
  };
  for (const LoggedEvent& event : events) {
    if (event.kind != "step" && event.kind != "measured" && event.kind != "phase_entered") continue;
    const Json json = parsed(event.line);
    const std::string name = text_in(json, "phase");
    if (event.kind == "phase_entered") {
      if (!phases.empty()) phases.back().last = std::max(phases.back().last, event.iteration);
      phase(name, event.iteration + 1);
    } else if (event.kind == "step") {
      LoggedPhase& now = phase(name, event.iteration);
      now.last = event.iteration;
      now.seconds += std::max(0.0, number_in(json, "seconds") - seconds);
      seconds = std::max(seconds, number_in(json, "seconds"));
    } else {
      LoggedPhase& now = phase(name, measured_to + 1);
      now.last = std::max(now.last, event.iteration);
      add_measured(json, static_cast<double>(event.iteration - measured_to), now.steps);
      measured_to = event.iteration;
    }
  }
  for (LoggedPhase& p : phases) {
    std::stable_sort(p.steps.begin(), p.steps.end(),
                     [](const profile::Entry& a, const profile::Entry& b) { return a.seconds > b.seconds; });
  }
  return phases;
}

std::vector<std::string> lines_of(const std::vector<LoggedEvent>& events) {
  std::vector<std::string> lines;
  lines.reserve(events.size());
  for (const LoggedEvent& event : events) lines.push_back(event.line);
  return lines;
}

}  // namespace traceflow
