#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>

#include "base/error.h"
#include "fuzz/promise.h"
#include "support/process_folder.h"

// What the fuzzers of the files' readers share: readers take paths, so an input becomes a file in memory.
namespace traceflow::fuzz {

inline std::string_view text_of(const uint8_t* data, size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

// A folder of one fuzzer's own. What is unpacked on the way comes to stand there as well.
class ScratchFolder {
 public:
  const std::filesystem::path& path() const { return folder_.path(); }
  std::filesystem::path write(const std::filesystem::path& name, std::string_view bytes) const {
    std::filesystem::path path = folder_.path() / name;
    const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    promise(descriptor >= 0, "there is handler for the input");
    promise(::write(descriptor, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()),
            "the input is written");
    ::close(descriptor);
    return path;
  }
  size_t files() const {
    using Walk = std::filesystem::recursive_directory_iterator;
    return static_cast<size_t>(std::distance(begin(Walk(path())), end(Walk(path()))));
  }

 private:
  ProcessFolder folder_;
};

// The lowest number that a descriptor could have: one that is left open shifts it.
inline int free_descriptor() {
  const int descriptor = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  ::close(descriptor);
  return descriptor;
}

// Whether it is read; what it throws otherwise is an InputError of one line that can be shown, and names
// `where`.
template <class F>
bool can_read(const std::string& where, F&& read) {
  try {
    read();
  } catch (const InputError& error) {
    const std::string_view text = error.what();
    promise(text.find(where) != std::string_view::npos, "an error names the file");
    promise(text.size() < 2000 + where.size(), "an error is short");
    for (const char c : text)
      promise(static_cast<unsigned char>(c) >= 32 && c != 127, "an error can be shown");
    return false;
  }
  return true;
}

// The same of what opens files.
template <class F>
bool accepts(const std::string& where, F&& read) {
  const int before = free_descriptor();
  const bool accepted = can_read(where, read);
  promise(free_descriptor() == before, "no file is left open");
  return accepted;
}

}  // namespace traceflow::fuzz
