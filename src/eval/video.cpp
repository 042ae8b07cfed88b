#include "eval/video.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <vector>

extern char** environ;

namespace traceflow::eval {

namespace {

bool ffmpeg_in_path() {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (::access((std::filesystem::path(folder) / "ffmpeg").c_str(), X_OK) == 0) return true;
  }
  return false;
}

}  // namespace

void Video::prepare(const std::filesystem::path& path) {
  if (!ffmpeg_in_path()) {
    throw InputError("option", "video", "no ffmpeg on this machine", "ffmpeg in PATH",
                     "install it with `apt install ffmpeg`, or leave --video out");
  }
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path());
}

void Video::start() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0)
    throw InputError(path_.string(), "video", std::strerror(errno), "a pipe");
  // A relative name could begin with a dash.
  const std::string output = std::filesystem::absolute(path_).string();
  std::vector<std::string> words = {
      "ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s",
      fmt::format("{}x{}", size_[1], size_[0]), "-r", fmt::format("{}", frames_per_second_), "-i", "-",
      // Most players want 4:2:0, which wants even sides.
      "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-crf", "18", output};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[0], STDIN_FILENO);
  const int error = ::posix_spawnp(&process_, "ffmpeg", &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[0]);
  pipe_ = ends[1];
  if (error != 0) {
    process_ = -1;
    throw InputError(path_.string(), "ffmpeg", std::strerror(error), "a program that starts");
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
  int status = 0;
  while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) {
  }
  process_ = -1;
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) fail();
}

Video::~Video() {
  if (pipe_ >= 0) ::close(pipe_);
  if (process_ >= 0) ::waitpid(process_, nullptr, 0);
}

}  // namespace traceflow::eval
