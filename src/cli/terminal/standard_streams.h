#pragma once

#include <iosfwd>

namespace traceflow::cli {

// Gives each of the standard streams that the program was started without a place that swallows it. Else the
// next file that is opened would take its number, and what is said its bytes.
void hold_standard_streams();

// Writes out what was printed to standard output. Where that fails, says so in a line on `err` and returns
// false.
bool flush_output(std::ostream& err);

}  // namespace traceflow::cli
