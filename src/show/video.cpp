#include "show/video.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <string>
#include <utility>
#include <vector>

extern char** environ;

namespace traceflow::show {

namespace {

// Starts ffmpeg with the given arguments, reading from `input` where that is not negative. 0 or the system's
// error.
int spawn_ffmpeg(std::vector<std::string> words, int input, pid_t& process) {
  words.insert(words.begin(), "ffmpeg");
  std::vector<char*> arguments(words.size() + 1, nullptr);
  for (size_t i = 0; i < words.size(); ++i) arguments[i] = words[i].data();
  // Ctrl-C goes to this program's group: the film is ended in good order from here.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  if (input >= 0) posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  const int error = ::posix_spawnp(&process, "ffmpeg", &actions, &attributes, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  return error;
}

// Whether the process ended well.
bool wait_for(pid_t process) {
  int status = 0;
  while (::waitpid(process, &status, 0) < 0) {
    if (errno != EINTR) return false;
  }
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

void Video::prepare(const std::filesystem::path& path) {
  pid_t process = -1;
  if (spawn_ffmpeg({"-version"}, -1, process) != 0 || !wait_for(process)) {
    throw InputError("option", "video", "no ffmpeg on this machine", "ffmpeg in PATH",
                     "install it with `apt install ffmpeg`, or leave --video out");
  }
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path());
}

void Video::start() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) fail();
  // A relative name could begin with a dash.
  const std::string output = std::filesystem::absolute(path_).string();
  const int error = spawn_ffmpeg(
      {"-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s",
       fmt::format("{}x{}", size_[1], size_[0]), "-r", fmt::format("{}", frames_per_second_), "-i", "-",
       // Most players want 4:2:0, which wants even sides.
       "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-crf", "18", output},
      ends[0], process_);
  ::close(ends[0]);
  pipe_ = ends[1];
  if (error != 0) {
    process_ = -1;
    fail();
  }
}

void Video::fail() const {
  throw InputError(path_.string(), "ffmpeg", "an error, said above", "a film",
                   "try another folder or file name");
}

void Video::add(const Tensor<uint8_t>& frame) {
  if (process_ < 0) {
    size_ = frame.shape();
    // ffmpeg may end early; the write must then fail instead of ending this program.
    std::signal(SIGPIPE, SIG_IGN);
    start();
  }
  if (frame.shape() != size_) {
    throw InputError(path_.string(), "video", "a frame of " + frame.shape().to_string(),
                     size_.to_string() + " as the first", "film cameras of one size");
  }
  const auto total = static_cast<size_t>(frame.size());
  for (size_t written = 0; written < total;) {
    const ssize_t n = ::write(pipe_, frame.data() + written, total - written);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail();
    written += static_cast<size_t>(n);
  }
}

void Video::finish() {
  if (process_ < 0) return;
  ::close(pipe_);
  pipe_ = -1;
  const bool good = wait_for(std::exchange(process_, -1));
  if (!good) fail();
}

Video::~Video() {
  if (pipe_ >= 0) ::close(pipe_);
  if (process_ >= 0) wait_for(process_);
}

}  // namespace traceflow::show
