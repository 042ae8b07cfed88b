#include "support/process_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string>

namespace traceflow {

namespace fs = std::filesystem;

namespace {

fs::path place() {
  const fs::path memory("/dev/shm");
  std::error_code error;
  const auto space = fs::space(memory, error);
  constexpr uintmax_t enough = uintmax_t{1} << 28;
  return !error && space.available >= enough ? memory : fs::temp_directory_path();
}

// Of a folder, given back when the descriptor is closed or its process ends; -1 where another holds it.
int lock(const fs::path& folder, int how) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0 || ::flock(descriptor, how) == 0) return descriptor;
  ::close(descriptor);
  return -1;
}

void remove_what_nobody_holds(const fs::path& parent) {
  std::error_code ignored;
  for (const auto& folder : fs::directory_iterator(parent, ignored)) {
    const int left = lock(folder.path(), LOCK_EX | LOCK_NB);
    if (left < 0) continue;
    fs::remove_all(folder.path(), ignored);
    ::close(left);
  }
}

}  // namespace

ProcessFolder::ProcessFolder() {
  const fs::path parent = place() / ("traceflow-tests-" + std::to_string(::getuid()));
  fs::create_directory(parent);
  // One program at a time, so that none removes a folder that another has made and not yet locked.
  const int making = lock(parent, LOCK_EX);
  remove_what_nobody_holds(parent);
  std::string name = (parent / "XXXXXX").string();
  if (::mkdtemp(name.data()) != nullptr) lock_ = lock(name, LOCK_EX);
  ::close(making);
  if (lock_ < 0) throw std::runtime_error("no temporary folder in " + parent.string());
  path_ = name;
  // Some tests run programs as another user, who has to come through here.
  fs::permissions(path_, fs::perms::group_exec | fs::perms::others_exec, fs::perm_options::add);
  ::setenv("TEST_TMPDIR", name.c_str(), 1);  // NOLINT(concurrency-mt-unsafe): no other thread runs yet
  ::setenv("TMPDIR", name.c_str(), 1);       // NOLINT(concurrency-mt-unsafe): likewise
}

ProcessFolder::~ProcessFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
  ::close(lock_);
}

}  // namespace traceflow
