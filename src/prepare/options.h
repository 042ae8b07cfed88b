#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/options.h"
#include "prepare/mask_white.h"

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
  MaskWhite mask_white = MaskWhite::automatic;
  std::string poses = "colmap";
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
    v.field("frames", frames, "frames", "Number of frames, spread evenly over time.");
    v.field("rate", rate, "frames/s",
            "Number of frames per second of video, instead of --frames; 0: use --frames.");
    v.field("start", start, "s", "Start of the part of the video to use.");
    v.field("end", end, "s", "End of the part of the video to use; 0: the end of the video.");
    v.field("size", size, "pixels", "Longest side of the images; larger images are scaled down.");
    v.field("masks", masks, "",
            "Masks of what moves: estimate, none, or a folder or video, in white and black or with labels of "
            "the moving objects.");
    v.field("mask_white", mask_white, "",
            "What is white in the supplied masks; automatic: determined from the border of the images.");
    v.field("poses", poses, "",
            "Where cameras come from: colmap, or an .npz file of MegaSaM with the cameras and depths of the "
            "frames.");
    v.field("matcher", matcher, "",
            "Pairs of frames to compare: sequential (near in time), exhaustive (all), or automatic "
            "(exhaustive up to 80 frames).");
    v.field("overlap", overlap, "frames",
            "Number of following frames that the sequential matcher compares with.");
    v.field("features", features, "features/picture",
            "Maximum number of features that COLMAP extracts from an image.");
    v.field("camera_model", camera_model, "", "Camera model of COLMAP.");
    v.field("least_registered", least_registered, "", "Minimum share of the frames that must get a pose.");
    v.field("test_every", test_every, "frames", "Every n-th frame is a test view.");
    v.field("test_video", test_video, "",
            "Video of a second camera, started at the same moment; its frames are the test views.");
    v.field("test_offset", test_offset, "s", "Time by which the second video starts after the first.");
    v.field("until", until, "", "The last step to run.");
  }
  void validate() const;
  // Whether a file has the cameras, so that COLMAP is not needed.
  bool gives_poses() const { return poses != "colmap"; }
};

}  // namespace traceflow::prepare
