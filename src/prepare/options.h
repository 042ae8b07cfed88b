#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/options.h"

namespace traceflow::prepare {

// The pairs of images that COLMAP compares.
enum class Matcher { automatic, sequential, exhaustive };
constexpr std::array<std::string_view, 3> enum_names(Matcher) {
  return {"automatic", "sequential", "exhaustive"};
}

// COLMAP's camera models that a capture supports.
enum class CameraModel { simple_pinhole, pinhole, simple_radial, radial, opencv };
constexpr std::array<std::string_view, 5> enum_names(CameraModel) {
  return {"simple-pinhole", "pinhole", "simple-radial", "radial", "opencv"};
}

// The steps, in order; each depends on those before it.
enum class Step { frames, masks, features, matches, poses, capture };
constexpr std::array<std::string_view, 6> enum_names(Step) {
  return {"frames", "masks", "features", "matches", "poses", "capture"};
}

struct PrepareOptions {
  int frames = 150;
  double rate = 0;
  double start = 0;
  double end = 0;
  int size = 960;
  std::string masks = "estimate";
  Matcher matcher = Matcher::automatic;
  int overlap = 10;
  int features = 4096;
  CameraModel camera_model = CameraModel::simple_radial;
  double least_registered = 0.6;
  int test_every = 8;
  std::string test_video;
  double test_offset = 0;
  Step until = Step::capture;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("frames", frames, "frames", "How many are taken, spread evenly over the time.");
    v.field("rate", rate, "frames/s",
            "How many are taken of each second, instead of --frames; 0: by --frames.");
    v.field("start", start, "s", "What comes before is left out.");
    v.field("end", end, "s", "What comes after is left out; 0: nothing.");
    v.field("size", size, "pixels", "Longest side of the pictures; larger ones are scaled down.");
    v.field("masks", masks, "",
            "Where something moves: estimate, none, or a folder or film with the moving object white.");
    v.field("matcher", matcher, "",
            "Which pictures are compared: each with those near in time, or all; automatic: all up to 80.");
    v.field("overlap", overlap, "frames", "How many pictures the sequential matcher looks ahead.");
    v.field("features", features, "features/picture", "Most features that COLMAP takes of a picture.");
    v.field("camera_model", camera_model, "", "COLMAP's lens.");
    v.field("least_registered", least_registered, "", "Share of the frames whose poses must be found.");
    v.field("test_every", test_every, "frames", "Every n-th picture tests.");
    v.field("test_video", test_video, "",
            "A second camera's film, started at the same moment, whose pictures test.");
    v.field("test_offset", test_offset, "s", "How much later than the first film the second was started.");
    v.field("until", until, "", "The last step to do.");
  }
  void validate() const;
};

}  // namespace traceflow::prepare
