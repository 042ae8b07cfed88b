#pragma once

#include <functional>
#include <iosfwd>

// The one place where errors end. Each becomes one line on `err` and an exit code.
namespace traceflow::cli {

inline constexpr int exit_done = 0;
inline constexpr int exit_input = 2;          // input or arguments that cannot be used
inline constexpr int exit_internal = 3;       // a broken promise inside the program: a bug
inline constexpr int exit_memory = 4;         // memory ran out
inline constexpr int exit_diverged = 5;       // a training run ended in numbers that are none, or collapsed
inline constexpr int exit_interrupted = 130;  // ended on request, its state saved

// Thrown by a verb that has said all there is to say and only has an exit code left.
struct Exit {
  int code;
};

// From now on what cannot reach a boundary, since it is thrown where nothing may be (libraries ask for memory
// in destructors), ends the program at once, with its line on standard error and its code. What is on disk is
// as a killed program leaves it.
void guard_termination();

// Runs `work`, which returns an exit code, and turns what it throws into a line and a code.
int guarded(const std::function<int()>& work, std::ostream& err);

}  // namespace traceflow::cli
