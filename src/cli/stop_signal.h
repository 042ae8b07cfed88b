#pragma once

#include <atomic>

namespace traceflow::cli {

// Set by Ctrl-C and SIGTERM from the first call on: long work saves what it has and ends. A second Ctrl-C
// ends the program at once.
std::atomic<bool>& stop_on_signals();

}  // namespace traceflow::cli
