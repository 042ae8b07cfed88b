#pragma once

#include <string>

#include "record/event_log.h"

// Lines of a training's log.
namespace traceflow::testing {

inline std::string log_line(const events::Event& event) { return to_json_line(event) + "\n"; }

inline std::string start_line(int64_t iteration) {
  events::Started start;
  start.iteration = iteration;
  return log_line(start);
}

}  // namespace traceflow::testing
