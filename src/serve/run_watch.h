#pragma once

#include <cstdint>
#include <filesystem>

#include "scene/run_folder.h"

namespace traceflow::serve {

// Looks whether a run that is shown goes on: another process may train it, or somebody move it away.
class RunWatch {
 public:
  // Takes the checkpoint that is there now for read; so make it before reading, lest one be missed that comes
  // meanwhile.
  explicit RunWatch(RunFolder run);

  struct Change {
    bool vanished = false;  // the run's checkpoints are not there
    bool saved = false;     // there is another checkpoint than the one read last
  };
  Change look();
  // What the last look saw has been read: until this is said, it is another at every look.
  void accept() { read_ = seen_; }

  const RunFolder& run() const { return run_; }

 private:
  // What tells one version of a file from the next.
  struct Version {
    int64_t size = -1;
    int64_t changed = 0;
    bool operator==(const Version&) const = default;
  };
  static Version version_of(const std::filesystem::path& path);

  RunFolder run_;
  Version seen_, read_;
};

}  // namespace traceflow::serve
