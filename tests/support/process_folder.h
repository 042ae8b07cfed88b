#pragma once

#include <filesystem>

namespace traceflow {

// The folder in which everything lies that a test program writes, removed with it at the end: as long as it
// stands, testing::TempDir() and std::filesystem::temp_directory_path() lead there, for programs that the
// tests start too. In memory where the system has room there: files are synced when they are written, which
// on a busy disk takes longer than the test. What programs left that were killed is removed by the next.
class ProcessFolder {
 public:
  ProcessFolder();
  ~ProcessFolder();
  ProcessFolder(const ProcessFolder&) = delete;
  ProcessFolder& operator=(const ProcessFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  int lock_ = -1;  // held while the program lives
};

}  // namespace traceflow
