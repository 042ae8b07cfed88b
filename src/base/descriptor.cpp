#include "base/descriptor.h"

#include <sys/stat.h>

namespace traceflow {

bool Descriptor::is_named(const std::filesystem::path& name) const {
  struct stat named {
  }, open{};
  return ::lstat(name.c_str(), &named) == 0 && ::fstat(number_, &open) == 0 && named.st_ino == open.st_ino &&
         named.st_dev == open.st_dev;
}

}  // namespace traceflow
