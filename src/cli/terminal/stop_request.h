#pragma once

#include <atomic>

namespace traceflow::cli {

// From now on Ctrl-C, SIGTERM and a terminal that goes away (SIGHUP, unless it is ignored) set this, which
// starts as false, so that a verb can end its work in good order. A second one ends the program at once. A
// reader of the program's output that goes away and a limit on the size of files do not end it: what they
// refuse is an error where it is written.
const std::atomic<bool>& stop_on_signals();

}  // namespace traceflow::cli
