#pragma once

#include <atomic>

namespace traceflow::cli {

// From now on Ctrl-C and SIGTERM set this, which starts as false, so that a verb can end its work in good
// order. A second one ends the program at once.
const std::atomic<bool>& stop_on_signals();

}  // namespace traceflow::cli
