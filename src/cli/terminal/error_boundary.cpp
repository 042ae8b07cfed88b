#include "cli/terminal/error_boundary.h"

#include <unistd.h>

#include <exception>
#include <iostream>
#include <new>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "base/device_memory.h"
#include "base/error.h"

namespace traceflow::cli {

namespace {

// Allocates no memory, since none may be left.
int report(std::ostream& err, const char* kind, std::string_view text, const char* remedy, int code) {
  err << "traceflow: " << kind;
  for (const char c : text) err << (c == '\n' ? ' ' : c);
  err << remedy << std::endl;
  return code;
}

}  // namespace

void guard_termination() {
  std::set_terminate([] {
    const std::exception_ptr thrown = std::current_exception();
    ::_exit(guarded(
        [&]() -> int {
          if (thrown) std::rethrow_exception(thrown);
          throw std::runtime_error("a library ended the program");
        },
        std::cerr));
  });
}

int guarded(const std::function<int()>& work, std::ostream& err) {
  constexpr const char* bug = "; this is a bug, please report it with the command that led here";
  try {
    return work();
  } catch (const Exit& e) {
    return e.code;
  } catch (const InputError& e) {
    return report(err, "", e.what(), "", exit_input);
  } catch (const std::system_error& e) {  // a file, stream or thread that the system refuses
    return report(err, "", e.what(), "", exit_input);
  } catch (const memory::OutOfMemory& e) {
    return report(err, "", e.what(), "; try a higher --downscale, or --device cpu", exit_memory);
  } catch (const std::bad_alloc&) {
    return report(err, "", "out of memory",
                  "; try a higher --downscale (of prepare: a lower --size) or a lower --memory-budget",
                  exit_memory);
  } catch (const std::exception& e) {
    return report(err, "internal error: ", e.what(), bug, exit_internal);
  } catch (...) {
    return report(err, "internal error: ", "something that is no std::exception was thrown", bug,
                  exit_internal);
  }
}

}  // namespace traceflow::cli
