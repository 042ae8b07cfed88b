#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/work.h"
#include "prepare/choose_frames.h"
#include "prepare/options.h"

// Pictures taken from a film or a folder of pictures.
namespace traceflow::prepare {

// A picture that was taken. Its file is ID.png in the frames' folder.
struct Frame {
  std::string id;
  int camera = 0;      // 0: trains, or is split; 1: of --test-video
  std::string source;  // of a folder: the name of the file that it comes from
  int64_t index = 0;   // its place in the film or folder
  double time = 0;     // seconds since the first picture taken, or its place in the folder
  double sharpness = 0;
  int64_t width = 0, height = 0;

  bool is_of_film() const { return source.empty(); }
};

struct Frames {
  std::vector<Frame> frames;           // in the order of time, camera 0 before 1
  std::vector<int64_t> source_frames;  // by camera: how many pictures there were to choose from
};

// Fewer make no scene; more are taken by no program that finds poses.
constexpr int64_t fewest_frames = 10, most_frames = 10000;

// Takes pictures as the options say, of `input` and of --test-video; writes them as ID.png into `folder`,
// which is emptied first. Throws InputError, and Stopped.
Frames take_frames(const std::filesystem::path& input, const PrepareOptions& options,
                   const std::filesystem::path& folder, const std::filesystem::path& log, const Work& work);

void write_frames(const std::filesystem::path& file, const Frames& frames);
Frames read_frames(const std::filesystem::path& path);

}  // namespace traceflow::prepare
