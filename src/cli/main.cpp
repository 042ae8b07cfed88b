#include "cli/program.h"
#include "cli/terminal/error_boundary.h"
#include "cli/terminal/standard_streams.h"

int main(int argc, char** argv) {
  traceflow::cli::hold_standard_streams();
  traceflow::cli::guard_termination();
  return traceflow::cli::run(argc, argv);
}
