#include "cli/terminal/standard_streams.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <iostream>
#include <system_error>

namespace traceflow::cli {

void hold_standard_streams() {
  // A new descriptor takes the lowest free number.
  for (int number = STDIN_FILENO; number <= STDERR_FILENO; ++number) {
    if (::fcntl(number, F_GETFD) < 0 && errno == EBADF) ::open("/dev/null", O_RDWR);
  }
}

bool flush_output(std::ostream& err) {
  std::cout.flush();
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout) return true;
  err << "traceflow: standard output: found " << std::generic_category().message(errno)
      << ", expected room for what was printed" << std::endl;
  return false;
}

}  // namespace traceflow::cli
