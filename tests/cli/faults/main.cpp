#include <gtest/gtest.h>

#include <string_view>

#include "cli/faults/world.h"
#include "cli/program.h"
#include "cli/terminal/error_boundary.h"
#include "cli/terminal/standard_streams.h"
#include "support/process_folder.h"

// The tests, or, where the first argument is `traceflow`, the program that they watch.
int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "traceflow") {
    traceflow::cli::hold_standard_streams();
    traceflow::cli::guard_termination();
    traceflow::faults::arm();
    return traceflow::cli::run(argc - 1, argv + 1);
  }
  ::testing::InitGoogleTest(&argc, argv);
  const traceflow::ProcessFolder folder;
  return RUN_ALL_TESTS();
}
