#include "cli/terminal/error_boundary.h"

#include <algorithm>
#include <filesystem>
#include <new>
#include <ostream>
#include <string>

#include "base/device_memory.h"
#include "base/error.h"

namespace traceflow::cli {

namespace {

int report(std::ostream& err, const char* kind, std::string text, const char* remedy, int code) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  err << "traceflow: " << kind << text << remedy << std::endl;
  return code;
}

}  // namespace

int guarded(const std::function<int()>& work, std::ostream& err) {
  constexpr const char* bug = "; this is a bug, please report it with the command that led here";
  try {
    return work();
  } catch (const Exit& e) {
    return e.code;
  } catch (const InputError& e) {
    return report(err, "", e.what(), "", exit_input);
  } catch (const std::filesystem::filesystem_error& e) {
    return report(err, "", e.what(), "", exit_input);
  } catch (const memory::OutOfMemory& e) {
    return report(err, "", e.what(), "; try a higher --downscale, or --device cpu", exit_memory);
  } catch (const std::bad_alloc&) {
    return report(err, "", "out of memory", "; try a higher --downscale or a lower --memory-budget",
                  exit_memory);
  } catch (const std::exception& e) {
    return report(err, "internal error: ", e.what(), bug, exit_internal);
  } catch (...) {
    return report(err, "internal error: ", "something that is no std::exception was thrown", bug,
                  exit_internal);
  }
}

}  // namespace traceflow::cli
