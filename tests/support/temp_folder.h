#pragma once

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace traceflow {

// A new empty folder for one test, removed with everything in it at the end. In memory where the system has
// room there: files are synced when they are written, which on a busy disk takes longer than the test.
class TempFolder {
 public:
  TempFolder() {
    std::string name = (parent() / "traceflow-test-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::filesystem::path& name) const { return path_ / name; }

 private:
  static std::filesystem::path parent() {
    const std::filesystem::path memory("/dev/shm");
    std::error_code error;
    const auto space = std::filesystem::space(memory, error);
    constexpr uintmax_t enough = uintmax_t{1} << 28;
    return !error && space.available >= enough ? memory : std::filesystem::temp_directory_path();
  }

  std::filesystem::path path_;
};

}  // namespace traceflow
