#pragma once

#include <atomic>

namespace traceflow::cli {

// From now on Ctrl-C, SIGTERM and a terminal that goes away (SIGHUP) set this, which starts as false, so that
// a verb can end its work in good order; Ctrl-C and SIGHUP only where whoever started the program has not had
// them ignored. The same one more than a second later ends the program at once, but for SIGHUP. Within that
// second it is the same request: `timeout` signals a program and its group, and a shell passes on the hang-up
// that the system sends too. A reader of the program's output that goes away and a limit on the size of files
// do not end it: what they refuse is an error where it is written.
const std::atomic<bool>& stop_on_signals();

}  // namespace traceflow::cli
