#pragma once

#include <filesystem>
#include <optional>

#include "base/process.h"
#include "base/tensor.h"

namespace traceflow::show {

// A film written by ffmpeg, which is fed frames through a pipe.
class Video {
 public:
  // Throws InputError when there is no ffmpeg, and makes the film's folder: to be called before any work
  // begins.
  static void prepare(const std::filesystem::path& path);

  Video(std::filesystem::path path, double frames_per_second)
      : path_(std::move(path)), frames_per_second_(frames_per_second) {}
  ~Video();
  Video(const Video&) = delete;
  Video& operator=(const Video&) = delete;

  // H×W×3; every frame has the first one's size, or InputError.
  void add(const Tensor<uint8_t>& frame);
  // Ends the film. Throws InputError when ffmpeg could not write it.
  void finish();

 private:
  void start();
  [[noreturn]] void fail() const;

  std::filesystem::path path_;
  double frames_per_second_;
  Shape size_;
  std::optional<Process> process_;
  Descriptor pipe_;
};

}  // namespace traceflow::show
