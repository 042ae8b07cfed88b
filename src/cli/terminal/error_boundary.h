#pragma once

#include <functional>
#include <iosfwd>

// The one place that handles errors: each becomes one line on `err` and an exit code.
namespace traceflow::cli {

inline constexpr int exit_done = 0;
inline constexpr int exit_input = 2;          // unusable input or arguments
inline constexpr int exit_internal = 3;       // a failed internal check: a bug
inline constexpr int exit_memory = 4;         // out of memory
inline constexpr int exit_diverged = 5;       // a training diverged to non-finite numbers, or collapsed
inline constexpr int exit_interrupted = 130;  // stopped on request, with its state saved

// Thrown by a verb that has printed its message and only needs an exit code.
struct Exit {
  int code;
};

// Handles errors that cannot reach a boundary, such as failed allocations in destructors of libraries: the
// program ends at once, with its line on standard error and its exit code. Files are left as after a kill.
void guard_termination();

// Runs `work`, which returns an exit code. Turns exceptions into a line and an exit code.
int guarded(const std::function<int()>& work, std::ostream& err);

}  // namespace traceflow::cli
