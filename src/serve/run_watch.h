#pragma once

#include <cstdint>
#include <filesystem>

#include "scene/run_folder.h"

namespace traceflow::serve {

// Polls the folder of a run, which another process may train, move or delete.
class RunWatch {
 public:
  // Counts the present checkpoint as read. Construct it before reading the checkpoint, so that one saved in
  // between is not missed.
  explicit RunWatch(RunFolder run);

  struct Change {
    bool vanished = false;  // the run has no checkpoint
    bool saved = false;     // the checkpoint differs from the one read last
  };
  Change poll();
  // Counts the checkpoint of the last poll as read. Until then each poll reports it.
  void accept() { read_ = seen_; }

  const RunFolder& run() const { return run_; }

 private:
  // Distinguishes versions of a file.
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
