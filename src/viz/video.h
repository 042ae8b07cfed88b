#pragma once

#include <filesystem>
#include <optional>

#include "base/atomic_file.h"
#include "base/descriptor.h"
#include "base/process.h"
#include "base/tensor.h"

namespace traceflow::viz {

// A video that ffmpeg encodes from frames sent through a pipe. The file gets its name when it is complete.
// Until then, and if it is never finished, an older file of the same name is kept.
class Video {
 public:
  // Creates the video's folder. Throws InputError if ffmpeg is missing. Call before any work starts.
  static void prepare(const std::filesystem::path& path);

  Video(std::filesystem::path path, double frames_per_second)
      : path_(std::move(path)), frames_per_second_(frames_per_second) {}
  Video(const Video&) = delete;
  Video& operator=(const Video&) = delete;

  // frame: H×W×3. Throws InputError if its size differs from the first frame's, or if another program is
  // writing this video.
  void add(const Tensor<uint8_t>& frame);
  // Completes the video. Throws InputError if ffmpeg could not write it.
  void finish();

 private:
  void start();
  [[noreturn]] void fail() const;

  std::filesystem::path path_;
  double frames_per_second_;
  Shape size_;
  std::optional<PartialFile> partial_;
  std::optional<Process> process_;  // must end before its output file is removed
  Descriptor pipe_;
};

}  // namespace traceflow::viz
