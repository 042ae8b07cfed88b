#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "scene/run_folder.h"

namespace traceflow::serve {

// Looks whether a run that is shown goes on: another process may train it, or somebody move it away.
class RunWatch {
 public:
  // Takes what is there now for known.
  explicit RunWatch(RunFolder run);

  struct Change {
    bool vanished = false;  // the run's checkpoints are not there
    bool returned = false;  // they are there again
    bool saved = false;     // there is another checkpoint than the last time
    bool logged = false;    // the log has become longer, or another one
  };
  Change look();

 private:
  // What tells one version of a file from the next.
  struct Version {
    int64_t size = -1;
    int64_t changed = 0;
    bool operator==(const Version&) const = default;
  };
  static Version version_of(const std::filesystem::path& path);

  RunFolder run_;
  Version checkpoint_, log_;
  bool gone_ = false;
};

}  // namespace traceflow::serve
