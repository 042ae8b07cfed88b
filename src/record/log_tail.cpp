#include "record/log_tail.h"

#include <algorithm>
#include <fstream>

namespace traceflow {

namespace {

// Long enough to identify a line: steps end with measured numbers.
constexpr size_t remembered = 512;

}  // namespace

std::string LogTail::end_of_read(std::istream& file) const {
  std::string end(std::min(static_cast<size_t>(read_.bytes), remembered), '\0');
  file.clear();
  file.seekg(read_.bytes - static_cast<int64_t>(end.size()));
  file.read(end.data(), static_cast<std::streamsize>(end.size()));
  end.resize(static_cast<size_t>(file.gcount()));
  return end;
}

LogTail::News LogTail::next() {
  std::ifstream file = open_events(path_);
  if (!file.is_open()) return {};
  News news;
  news.anew = !begun_ || end_of_read(file) != last_read_;
  if (news.anew) {
    *this = LogTail(path_);
    begun_ = true;
  }
  file.clear();
  file.seekg(read_.bytes);
  bool taken_back = false;
  while (!read_.is_all()) {
    const LogLine line = next_line(file);
    if (!line.ended) break;
    read_.bytes += line.bytes;
    std::optional<LoggedEvent> event = read_event(line.text);
    if (!event) continue;
    ++read_.events;
    const bool start = event->kind == "started", step = event->kind == "step";
    taken_back = taken_back || start || (step && event->iteration <= iteration_);
    if (start || step) iteration_ = event->iteration;
    news.events.push_back(std::move(*event));
  }
  last_read_ = end_of_read(file);
  if (news.anew) {
    news.events = that_count(std::move(news.events));
  } else if (taken_back) {
    begun_ = false;
    return next();
  }
  return news;
}

}  // namespace traceflow
