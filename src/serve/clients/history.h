#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

namespace traceflow::serve {

// The lines of a training log that a page gets when it connects. Keeps every n-th step and doubles n as the
// run gets longer, so that the number of lines stays bounded.
class History {
 public:
  // line: of log.jsonl, or a step between the logged ones.
  void add(const std::string& line);
  void clear();
  // In the order of arrival.
  std::vector<std::string> lines() const;

 private:
  struct Line {
    std::string text;
    int64_t step;  // the step's iteration, or -1 for other events
  };
  std::deque<Line> lines_;
  int64_t steps_ = 0;
  int64_t stride_ = 1;
};

// {"type": "events", …} with these lines.
std::string events_text(const std::vector<std::string>& lines, bool reset);

}  // namespace traceflow::serve
