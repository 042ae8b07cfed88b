#pragma once

#include <filesystem>
#include <optional>

#include "base/atomic_file.h"
#include "base/descriptor.h"
#include "base/process.h"
#include "base/tensor.h"

namespace traceflow::viz {

// A film written by ffmpeg, which is fed frames through a pipe. It takes its name when it is whole: until
// then, and where it is never finished, what bore the name before stays.
class Video {
 public:
  // Throws InputError when there is no ffmpeg, and makes the film's folder: to be called before any work
  // begins.
  static void prepare(const std::filesystem::path& path);

  Video(std::filesystem::path path, double frames_per_second)
      : path_(std::move(path)), frames_per_second_(frames_per_second) {}
  Video(const Video&) = delete;
  Video& operator=(const Video&) = delete;

  // H×W×3. Throws InputError for a frame of another size than the first one's, and where another program is
  // writing this film.
  void add(const Tensor<uint8_t>& frame);
  // Ends the film. Throws InputError when ffmpeg could not write it.
  void finish();

 private:
  void start();
  [[noreturn]] void fail() const;

  std::filesystem::path path_;
  double frames_per_second_;
  Shape size_;
  std::optional<PartialFile> partial_;
  std::optional<Process> process_;  // ended before the file goes that it writes
  Descriptor pipe_;
};

}  // namespace traceflow::viz
