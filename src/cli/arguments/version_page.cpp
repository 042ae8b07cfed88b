#include "cli/arguments/version_page.h"

#include <fmt/format.h>

#include "base/parallel.h"
#include "base/version.h"
#include "cli/arguments/device_arguments.h"
#include "primitives/instructions.h"

namespace traceflow::cli {

std::string version_page() {
#ifdef __clang__
  const char* const compiler = "Clang " __clang_version__;
#else
  const char* const compiler = "GCC " __VERSION__;
#endif
  return fmt::format(
      "traceflow {}\n"
      "compiler: {}, {}\n"
      "libraries at build time: {}\n"
      "instructions: {}\n"
      "threads: {}\n"
      "CUDA: {}",
      version(), compiler, TRACEFLOW_BUILD_TYPE, TRACEFLOW_LIBRARIES, instructions_in_use(), thread_count(),
      cuda_text());
}

}  // namespace traceflow::cli
