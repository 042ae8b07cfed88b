#include "cli/faults/world.h"

#include <fcntl.h>
#include <grp.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace traceflow::faults {

namespace {

constexpr uid_t nobody = 65534;

std::string new_file() {
  std::string name = (std::filesystem::temp_directory_path() / "said-XXXXXX").string();
  const int descriptor = ::mkstemp(name.data());
  if (descriptor < 0) throw std::runtime_error("no temporary file");
  ::fchmod(descriptor, 0666);
  ::close(descriptor);
  return name;
}

std::string taken(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void lead(int stream, const char* path) {
  const int descriptor = ::open(path, O_WRONLY | O_APPEND);
  if (descriptor < 0 || ::dup2(descriptor, stream) < 0) ::_exit(99);
  ::close(descriptor);
}

// Between fork and exec: nothing here asks for memory.
[[noreturn]] void become(int program, char* const* words, char* const* environment, const World& world,
                         const char* output, const char* error) {
  if (world.file_bytes > 0) {
    const rlimit limit{static_cast<rlim_t>(world.file_bytes), static_cast<rlim_t>(world.file_bytes)};
    if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) ::_exit(99);
  }
  for (const int number : {SIGHUP, SIGINT, SIGPIPE, SIGXFSZ}) ::signal(number, SIG_DFL);
  if (world.hangup_ignored) ::signal(SIGHUP, SIG_IGN);
  lead(STDOUT_FILENO, output);
  lead(STDERR_FILENO, error);
  if (world.output_closed) ::close(STDOUT_FILENO);
  if (world.error_closed) ::close(STDERR_FILENO);
  if (world.is_nobody && ::geteuid() == 0 &&
      (::setgroups(0, nullptr) != 0 || ::setgid(nobody) != 0 || ::setuid(nobody) != 0)) {
    ::_exit(99);
  }
  ::fexecve(program, words, environment);
  ::_exit(99);
}

int64_t number_after(const std::string& before, const std::string& text) {
  const size_t at = text.rfind(before);
  return at == std::string::npos ? 0 : std::atoll(text.c_str() + at + before.size());
}

std::vector<char*> pointers(std::vector<std::string>& words) {
  std::vector<char*> result;
  result.reserve(words.size() + 1);
  for (std::string& word : words) result.push_back(word.data());
  result.push_back(nullptr);
  return result;
}

}  // namespace

Process::Process(const std::vector<std::string>& words, const World& world)
    : output_(world.output.empty() ? new_file() : ""), error_(world.error.empty() ? new_file() : "") {
  std::vector<std::string> all{"test", "traceflow"};
  all.insert(all.end(), words.begin(), words.end());
  std::vector<std::string> told;
  for (char** entry = environ; *entry != nullptr; ++entry) told.emplace_back(*entry);
  told.push_back("FAULTS_ALLOCATION=" + std::to_string(world.failing_allocation));
  told.push_back(std::string("FAULTS_FROM_THERE=") + (world.failing_from_there ? "1" : "0"));
  told.push_back("FAULTS_DISK=" + world.disk.to_text());
  told.push_back(std::string("FAULTS_CLOCK=") + (world.clock_jumps ? "1" : "0"));
  const std::vector<char*> arguments = pointers(all), environment = pointers(told);
  const int program = ::open("/proc/self/exe", O_RDONLY | O_CLOEXEC);
  process_ = ::fork();
  if (process_ < 0) throw std::runtime_error("no process");
  if (process_ == 0) {
    become(program, arguments.data(), environment.data(), world,
           (output_.empty() ? world.output : output_).c_str(),
           (error_.empty() ? world.error : error_).c_str());
  }
  ::close(program);
}

Process::~Process() {
  if (!reaped_) {
    send(SIGKILL);
    wait();
  }
}

bool Process::has_ended() {
  if (!reaped_) reaped_ = ::waitpid(process_, &status_, WNOHANG) == process_;
  return reaped_;
}

void Process::send(int signal_number) const { ::kill(process_, signal_number); }

Outcome Process::wait() {
  if (!reaped_) ::waitpid(process_, &status_, 0);
  reaped_ = true;
  Outcome outcome;
  outcome.code = WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_);
  for (auto [file, text] : {std::pair(&output_, &outcome.output), std::pair(&error_, &outcome.error)}) {
    if (file->empty()) continue;
    *text = taken(*file);
    ::unlink(file->c_str());
    file->clear();
  }
  return outcome;
}

Outcome run(const std::vector<std::string>& words, const World& world) {
  return Process(words, world).wait();
}

int64_t allocations_said(const std::string& error) { return number_after("allocations: ", error); }
int64_t disk_calls_said(const std::string& error) { return number_after("calls to the disk: ", error); }

}  // namespace traceflow::faults
