#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>

#include "base/error.h"
#include "primitives/instructions.h"
#include "support/process_folder.h"

namespace {

// What ctest takes for a skipped test.
constexpr int skipped = 77;

traceflow::Instructions instructions_of(const std::string& name) {
  constexpr auto names = enum_names(traceflow::Instructions{});
  return static_cast<traceflow::Instructions>(std::find(names.begin(), names.end(), name) - names.begin());
}

}  // namespace

// The environment's TRACEFLOW_INSTRUCTIONS (sse4, avx2, avx512) limits the vector instructions of what is
// tested.
int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  // NOLINTNEXTLINE(concurrency-mt-unsafe): no other thread runs yet
  if (const char* name = std::getenv("TRACEFLOW_INSTRUCTIONS")) {
    try {
      traceflow::limit_instructions(instructions_of(name));
    } catch (const traceflow::InputError& error) {
      std::cout << error.what() << "\n";
      return skipped;
    }
  }
  const traceflow::ProcessFolder folder;
  return RUN_ALL_TESTS();
}
