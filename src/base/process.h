#pragma once

#include <sys/types.h>

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/descriptor.h"

// Other programs, started without a shell.
namespace traceflow {

// Whether a program of this name can be started.
bool is_in_path(const std::string& program);

// Where a program's streams come from and go to, as descriptors that stay the caller's; -1 is nothing to
// read, and nobody who listens. `environment` has "NAME=value" beyond this program's own.
struct ProcessStreams {
  int input = -1, output = -1, error = -1;
  std::vector<std::string> environment = {};
};

// A running program, in a process group of its own: Ctrl-C reaches this program alone, which then decides.
// What is still running when this is destroyed is ended. Where SIGCHLD was ignored, it no longer is.
class Process {
 public:
  // words: the program, found in PATH, and its arguments. Throws InputError where it cannot be started.
  Process(const std::vector<std::string>& words, const ProcessStreams& streams);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // Until it has ended by itself: whether well.
  bool wait();
  // The same, unless `stop` turns true: then it and what it has started are ended, and the answer is false.
  // Calls `meanwhile` some times a second.
  bool wait(
      const std::atomic<bool>& stop, const std::function<void()>& meanwhile = [] {});
  // Asks it and what it has started to end, and insists after two seconds.
  void end();

 private:
  pid_t id_ = -1;
};

// Both ends of a pipe, which programs that are started do not inherit.
struct Pipe {
  Descriptor reading, writing;
};
Pipe make_pipe();

// A file to write a program's output to, emptied first. Throws InputError.
Descriptor open_log(const std::filesystem::path& path);

}  // namespace traceflow
