#pragma once

#include <string>

namespace traceflow::cli {

// What a report of a bug needs: the program's version in the first line, then the compiler, the libraries,
// the instructions and threads in use, and the CUDA device. Without a newline at its end.
std::string version_page();

}  // namespace traceflow::cli
