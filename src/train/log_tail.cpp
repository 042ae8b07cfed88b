#include "train/log_tail.h"

#include <algorithm>
#include <fstream>

namespace traceflow {

namespace {

// Enough of a line to tell it from every other: steps end with measured numbers.
constexpr size_t remembered = 512;

}  // namespace

bool LogTail::goes_on(std::istream& file) const {
  std::string there(last_read_.size(), '\0');
  file.seekg(read_ - static_cast<int64_t>(there.size()));
  file.read(there.data(), static_cast<std::streamsize>(there.size()));
  return file && there == last_read_;
}

LogTail::News LogTail::next() {
  std::ifstream file(path_, std::ios::binary);
  if (!file) return {};
  News news;
  news.anew = !begun_ || !goes_on(file);
  if (news.anew) {
    *this = LogTail(path_);
    begun_ = true;
    file.clear();
    file.seekg(0);
  }
  bool taken_back = false;
  for (std::string line; std::getline(file, line) && !file.eof();) {
    read_ += static_cast<int64_t>(line.size()) + 1;
    last_read_ = (last_read_ + line + '\n');
    last_read_.erase(0, last_read_.size() - std::min(last_read_.size(), remembered));
    std::optional<LoggedEvent> event = read_event(line);
    if (!event) continue;
    const bool start = event->kind == "started", step = event->kind == "step";
    taken_back = taken_back || start || (step && event->iteration <= iteration_);
    if (start || step) iteration_ = event->iteration;
    news.events.push_back(std::move(*event));
  }
  if (news.anew) {
    news.events = that_count(std::move(news.events));
  } else if (taken_back) {
    begun_ = false;
    return next();
  }
  return news;
}

}  // namespace traceflow
