#pragma once

#include <filesystem>
#include <string>

#include "scene/run_folder.h"

namespace traceflow {

// Keeps a second training out of a run's folder for as long as this stands. Readers are free. The system lets
// go of it when the program ends, however it ends.
class RunLock {
 public:
  // The folder must be there. Throws InputError, naming who holds it, when another process does, and when the
  // folder cannot be written to.
  explicit RunLock(const RunFolder& run);
  ~RunLock();
  RunLock(const RunLock&) = delete;
  RunLock& operator=(const RunLock&) = delete;

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
};

}  // namespace traceflow
