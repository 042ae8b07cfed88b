#pragma once

#include <sys/types.h>

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/descriptor.h"

// Starts other programs, without a shell.
namespace traceflow {

// Whether a program of this name is in PATH and executable.
bool is_in_path(const std::string& program);

// The program's streams, as descriptors that the caller keeps; -1 means /dev/null. `environment` has
// "NAME=value" entries in addition to this program's own.
struct ProcessStreams {
  int input = -1, output = -1, error = -1;
  std::vector<std::string> environment = {};
};

// A running program in its own process group: Ctrl-C reaches only this program, which then decides. The
// destructor ends what is still running. If SIGCHLD was ignored, its default handling is restored.
class Process {
 public:
  // words: the program, found in PATH, and its arguments. Throws InputError if it cannot be started.
  Process(const std::vector<std::string>& words, const ProcessStreams& streams);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // Waits until it ends by itself. Returns whether it succeeded.
  bool wait();
  // The same, unless `stop` becomes true: then ends it and its children, and returns false. Calls `meanwhile`
  // several times a second.
  bool wait(
      const std::atomic<bool>& stop, const std::function<void()>& meanwhile = [] {});
  // Asks it and its children to end, and kills them after two seconds.
  void end();

 private:
  pid_t id_ = -1;
};

// Both ends of a pipe; started programs do not inherit them.
struct Pipe {
  Descriptor reading, writing;
};
Pipe make_pipe();

// Opens an empty file for a program's output. Throws InputError.
Descriptor open_log(const std::filesystem::path& path);

}  // namespace traceflow
