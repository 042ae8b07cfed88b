#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/work.h"
#include "prepare/choose_frames.h"
#include "prepare/options.h"

// Images selected from a video or a folder of images.
namespace traceflow::prepare {

// A selected image. Its file is ID.png in the frames' folder.
struct Frame {
  std::string id;
  int camera = 0;      // 0: for training, or split; 1: of --test-video
  std::string source;  // for a folder: the name of the original file
  int64_t index = 0;   // its index in the video or folder
  double time = 0;     // seconds since the first selected image, or its index in the folder
  double sharpness = 0;
  int64_t width = 0, height = 0;

  bool is_of_film() const { return source.empty(); }
};

struct Frames {
  std::vector<Frame> frames;           // in time order, camera 0 before 1
  std::vector<int64_t> source_frames;  // by camera: the number of images to select from
};

// Fewer frames make no scene; programs that find poses accept no more.
constexpr int64_t fewest_frames = 10, most_frames = 10000;

// Selects images of `input` and of --test-video by the options and writes them as ID.png into `folder`, which
// is first emptied. Throws InputError and Stopped.
Frames take_frames(const std::filesystem::path& input, const PrepareOptions& options,
                   const std::filesystem::path& folder, const std::filesystem::path& log, const Work& work);

void write_frames(const std::filesystem::path& file, const Frames& frames);
Frames read_frames(const std::filesystem::path& path);

}  // namespace traceflow::prepare
