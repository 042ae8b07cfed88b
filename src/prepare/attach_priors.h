#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "capture/capture.h"
#include "capture/prior_axes.h"

namespace traceflow::prepare {

struct AttachOptions {
  std::string normals;
  std::string masks;
  std::string tracks;
  int tracks_width = 0;
  PriorAxes axes = PriorAxes::automatic;
  bool force = false;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("normals", normals, "",
            "An .npz or .npy array T×H×W×3 of normals, a film of pictures of them, or a folder of such "
            "pictures.");
    v.field("masks", masks, "", "A folder or film with the moving object white.");
    v.field("tracks", tracks, "",
            "An .npz array of points that were tracked: tracks (T×N×2, pixels) and visibility (T×N).");
    v.field("tracks_width", tracks_width, "pixels",
            "Width of the pictures that were tracked; 0: that of the photographs.");
    v.field("axes", axes, "", "Axes of the normals; automatic: by agreement with the capture's points.");
    v.field("force", force, "", "Replaces normals, masks and tracks that are there.");
  }
  void validate() const;
};

// Puts normals, masks and tracks of other programs into the folder of a capture of any format:
// normal/1x/ID.png with 16 bits and the axes that are the default there (x right, y up, z to the viewer),
// mask/1x/ID.png.png, tracks.npy. `say` gets a line for everything found. Throws InputError, with the capture
// as it was, also where another process is at it; and Stopped.
void attach_priors(const std::filesystem::path& capture, const AttachOptions& options,
                   const std::function<void(const std::string& line)>& say, const std::atomic<bool>& stop);

// The ids of a capture's views in its own order, and all that it lists, of which some may have no photograph
// or stand in neither split.
struct ViewIds {
  std::vector<std::string> train, all;
  std::vector<std::string> listed_train, listed;
};

// Which of `count` pictures belongs to which view: by name, where every training view finds its own; else by
// order, one for each training view, for each view, or for each that is listed so. Throws InputError where
// none of these fits.
std::map<std::string, int64_t> match_views(const std::string& origin, const std::vector<std::string>& names,
                                           int64_t count, const ViewIds& ids);

// The signs of the axes of normals against the camera's (x right, y down, z forward), and in words how they
// were found. automatic: the one of the known axes that the evidence agrees with, else the evidence's own;
// InputError where several agree, or it does not decide.
struct FoundAxes {
  Vec3<double> signs{1};
  std::string text;
};
FoundAxes find_axes(PriorAxes asked, const AxisEvidence& evidence, const std::string& origin);

}  // namespace traceflow::prepare
