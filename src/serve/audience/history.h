#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

namespace traceflow::serve {

// What is told of a training run to whoever comes later: lines of its log. Of the steps, every n-th is kept,
// n doubling as the run gets long, so that the number of lines stays bounded.
class History {
 public:
  // A line of log.jsonl, or of a step between the logged ones.
  void add(const std::string& line);
  void clear();
  // In the order in which they came.
  std::vector<std::string> lines() const;

 private:
  struct Line {
    std::string text;
    int64_t step;  // its iteration, or -1 for an event of another kind
  };
  std::deque<Line> lines_;
  int64_t steps_ = 0;
  int64_t stride_ = 1;
};

// {"type": "events", …} of such lines.
std::string events_text(const std::vector<std::string>& lines, bool reset);

}  // namespace traceflow::serve
