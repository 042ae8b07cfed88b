#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "capture/capture.h"
#include "capture/prior_axes.h"
#include "prepare/depth_fit.h"
#include "prepare/mask_white.h"

namespace traceflow::prepare {

struct AttachOptions {
  std::string normals;
  std::string masks;
  MaskWhite mask_white = MaskWhite::automatic;
  std::string tracks;
  int tracks_width = 0;
  std::string depth;
  DepthKind depth_kind = DepthKind::automatic;
  PriorAxes axes = PriorAxes::automatic;
  bool force = false;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("normals", normals, "",
            "Normals: an .npz or .npy array T×H×W×3, a video, or a folder of images.");
    v.field("masks", masks, "",
            "Masks: a folder or video, in white and black or with labels of the moving objects.");
    v.field("mask_white", mask_white, "",
            "What is white in the masks; automatic: determined from the border of the images.");
    v.field(
        "tracks", tracks, "",
        "Point tracks: an .npz file with the arrays tracks and visibility (CoTracker) or visibles (TAPIR).");
    v.field("tracks_width", tracks_width, "pixels",
            "Width of the tracked images; 0: the width of the capture's images.");
    v.field(
        "depth", depth, "",
        "Depths: an .npz or .npy array T×H×W, a folder of arrays or grey images, or a video. A scale and a "
        "shift are fitted to the capture's points in each view.");
    v.field("depth_kind", depth_kind, "",
            "What the values of --depth are: depth, inverse depth, or what fits the points better.");
    v.field("axes", axes, "", "Axes of the normals; automatic: determined with the capture's points.");
    v.field("force", force, "", "Replace existing normals, masks, tracks and depths.");
  }
  void validate() const;
};

// Adds normals, masks, tracks and depths of other programs to a capture of any format: normal/1x/ID.png with
// 16 bits and the default axes (x right, y up, z to the viewer), mask/1x/ID.png.png, tracks.npy,
// depth/1x/ID.npy in the capture's units. `say` gets a line for each result. Throws InputError, also if
// another process is changing the capture, and Stopped; the capture is then unchanged.
void attach_priors(const std::filesystem::path& capture, const AttachOptions& options,
                   const std::function<void(const std::string& line)>& say, const std::atomic<bool>& stop);

// The ids of a capture's views in its own order, and all ids that it lists. Some of these may have no
// photograph or be in neither split.
struct ViewIds {
  std::vector<std::string> train, all;
  std::vector<std::string> listed_train, listed;
};

// Assigns `count` images to views. By name, if each training view has an image of its name. Else by order, if
// there is one for each training view, for each view or for each listed id. Otherwise throws InputError.
std::map<std::string, int64_t> match_views(const std::string& origin, const std::vector<std::string>& names,
                                           int64_t count, const ViewIds& ids);

// The signs of the normals' axes relative to the camera's (x right, y down, z forward), and a text on how
// they were found. automatic: the known axes that the evidence agrees with, else the evidence's own. Throws
// InputError if several agree, or if the evidence does not decide.
struct FoundAxes {
  Vec3<double> signs{1};
  std::string text;
};
FoundAxes find_axes(PriorAxes asked, const AxisEvidence& evidence, const std::string& origin);

}  // namespace traceflow::prepare
