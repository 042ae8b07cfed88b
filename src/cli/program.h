#pragma once

namespace traceflow::cli {

// Parses the arguments, runs the verb and returns the exit code (error_boundary.h).
int run(int argc, const char* const* argv);

}  // namespace traceflow::cli
