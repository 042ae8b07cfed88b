#include "viz/video.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <string>
#include <utility>
#include <vector>

namespace traceflow::viz {

void Video::prepare(const std::filesystem::path& path) {
  if (!is_in_path("ffmpeg") || !Process({"ffmpeg", "-version"}, {.error = STDERR_FILENO}).wait()) {
    throw InputError("option", "video", "no ffmpeg on this machine", "ffmpeg in PATH",
                     "install it with `apt install ffmpeg`, or leave --video out");
  }
  make_folder(path.parent_path());
}

void Video::start() {
  // ffmpeg selects the format by the last extension.
  partial_.emplace(path_, PartialFile::OtherWriter::refused, ".partial" + path_.extension().string());
  Pipe pipe = make_pipe();
  // A relative path could start with a dash.
  const std::string output = std::filesystem::absolute(partial_->name()).string();
  process_.emplace(
      std::vector<std::string>{
          "ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s",
          fmt::format("{}x{}", size_[1], size_[0]), "-r", fmt::format("{}", frames_per_second_), "-i", "-",
          // Most players need 4:2:0, which needs even sides.
          "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-crf", "18", output},
      ProcessStreams{.input = pipe.reading.number(), .error = STDERR_FILENO});
  pipe_ = std::move(pipe.writing);
}

void Video::fail() const {
  throw InputError(path_.string(), "ffmpeg", "an error, said above", "a film",
                   "try another folder or file name");
}

void Video::add(const Tensor<uint8_t>& frame) {
  if (!process_) {
    size_ = frame.shape();
    // If ffmpeg ends early, the write must fail without ending this program.
    std::signal(SIGPIPE, SIG_IGN);
    start();
  }
  if (frame.shape() != size_) {
    throw InputError(path_.string(), "video", "a frame of " + frame.shape().to_string(),
                     size_.to_string() + " as the first", "film cameras of one size");
  }
  const auto total = static_cast<size_t>(frame.size());
  for (size_t written = 0; written < total;) {
    const ssize_t n = ::write(pipe_.number(), frame.data() + written, total - written);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail();
    written += static_cast<size_t>(n);
  }
}

void Video::finish() {
  if (!process_) return;
  pipe_.close();
  const bool good = process_->wait();
  process_.reset();
  if (!good) fail();
  partial_->put_in_place();
  partial_.reset();
}

}  // namespace traceflow::viz
