#include "base/process.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <sstream>
#include <system_error>
#include <thread>

#include "base/error.h"

extern char** environ;

namespace traceflow {

namespace {

constexpr auto glance = std::chrono::milliseconds(20);
constexpr auto patience = std::chrono::seconds(2);

std::vector<char*> as_arguments(std::vector<std::string>& words) {
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  return arguments;
}

// If SIGCHLD is ignored, as a parent may have left it, the system keeps no exit status and every program
// seems to fail. It is reset here because not every caller sets up signals first.
void keep_exit_statuses() {
  struct sigaction action {};
  if (::sigaction(SIGCHLD, nullptr, &action) == 0 && action.sa_handler == SIG_IGN)
    std::signal(SIGCHLD, SIG_DFL);
}

// Arguments of posix_spawn, freed by the destructor.
class SpawnPlan {
 public:
  explicit SpawnPlan(const ProcessStreams& streams) {
    posix_spawnattr_init(&attributes_);
    posix_spawn_file_actions_init(&actions_);
    posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETPGROUP);
    posix_spawnattr_setpgroup(&attributes_, 0);
    connect(STDIN_FILENO, streams.input, O_RDONLY);
    connect(STDOUT_FILENO, streams.output, O_WRONLY);
    connect(STDERR_FILENO, streams.error, O_WRONLY);
  }
  ~SpawnPlan() {
    posix_spawn_file_actions_destroy(&actions_);
    posix_spawnattr_destroy(&attributes_);
  }
  SpawnPlan(const SpawnPlan&) = delete;
  SpawnPlan& operator=(const SpawnPlan&) = delete;

  int spawn(std::vector<std::string> words, std::vector<std::string> additions, pid_t& id) const {
    std::vector<char*> environment = as_arguments(additions);
    environment.pop_back();
    for (char** entry = environ; *entry != nullptr; ++entry) environment.push_back(*entry);
    environment.push_back(nullptr);
    return ::posix_spawnp(&id, words.front().c_str(), &actions_, &attributes_, as_arguments(words).data(),
                          environment.data());
  }

 private:
  void connect(int to, int from, int mode) {
    if (from < 0) {
      posix_spawn_file_actions_addopen(&actions_, to, "/dev/null", mode, 0);
    } else {
      posix_spawn_file_actions_adddup2(&actions_, from, to);
    }
  }

  posix_spawnattr_t attributes_{};
  posix_spawn_file_actions_t actions_{};
};

}  // namespace

bool is_in_path(const std::string& program) {
  const char* path = std::getenv("PATH");  // NOLINT(concurrency-mt-unsafe): nobody here writes there
  std::istringstream folders(path == nullptr ? "/usr/bin:/bin" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const std::filesystem::path file = std::filesystem::path(folder.empty() ? "." : folder) / program;
    std::error_code error;
    if (std::filesystem::is_regular_file(file, error) && ::access(file.c_str(), X_OK) == 0) return true;
  }
  return false;
}

Process::Process(const std::vector<std::string>& words, const ProcessStreams& streams) {
  keep_exit_statuses();
  const int error = SpawnPlan(streams).spawn(words, streams.environment, id_);
  if (error == 0) return;
  id_ = -1;
  throw InputError(words.front(), "", std::system_category().message(error), "a program in PATH");
}

Process::~Process() { end(); }

bool Process::wait() {
  int status = 0;
  while (id_ >= 0 && ::waitpid(id_, &status, 0) < 0) {
    if (errno == EINTR) continue;
    // Another thread has waited for it. The id may belong to a new process by now, which end() must not
    // signal.
    id_ = -1;
    return false;
  }
  id_ = -1;
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

bool Process::wait(const std::atomic<bool>& stop, const std::function<void()>& meanwhile) {
  siginfo_t info{};
  for (int glances = 1; !stop; ++glances) {
    if (::waitid(P_PID, static_cast<id_t>(id_), &info, WEXITED | WNOHANG | WNOWAIT) != 0 || info.si_pid != 0)
      return wait();
    std::this_thread::sleep_for(glance);
    if (glances % 10 == 0) meanwhile();
  }
  end();
  return false;
}

void Process::end() {
  if (id_ < 0) return;
  const pid_t group = -id_;
  ::kill(group, SIGTERM);
  siginfo_t info{};
  for (auto waited = glance; waited < patience; waited += glance) {
    if (::waitid(P_PID, static_cast<id_t>(id_), &info, WEXITED | WNOHANG | WNOWAIT) != 0 || info.si_pid != 0)
      break;
    std::this_thread::sleep_for(glance);
  }
  // The group's id cannot be reused before its leader has been waited for.
  ::kill(group, SIGKILL);
  wait();
}

Pipe make_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw InputError("pipe", "", std::system_category().message(errno), "two free descriptors");
  }
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

Descriptor open_log(const std::filesystem::path& path) {
  Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  if (!file) {
    throw InputError(path.string(), "open", std::system_category().message(errno), "a writable file",
                     "check space and permissions");
  }
  return file;
}

}  // namespace traceflow
