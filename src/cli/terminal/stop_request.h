#pragma once

#include <atomic>

namespace traceflow::cli {

// Returns a flag, false at first. From now on Ctrl-C, SIGTERM and SIGHUP (a closed terminal) set it, so that
// a verb can finish cleanly. Ctrl-C and SIGHUP are left alone if the parent process had them ignored. A
// second signal of the same kind more than a second later ends the program at once, except SIGHUP. Within
// that second it counts as the same request: `timeout` signals a program and its group, and a shell forwards
// the SIGHUP that the system also sends. A closed pipe and the file size limit do not end the program: they
// become write errors.
const std::atomic<bool>& stop_on_signals();

}  // namespace traceflow::cli
