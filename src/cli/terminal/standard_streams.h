#pragma once

#include <iosfwd>

namespace traceflow::cli {

// Opens /dev/null for each standard stream that is closed. Otherwise the next opened file would get its
// number, and printed text would go into that file.
void hold_standard_streams();

// Flushes standard output. If that fails, prints a line to `err` and returns false.
bool flush_output(std::ostream& err);

}  // namespace traceflow::cli
