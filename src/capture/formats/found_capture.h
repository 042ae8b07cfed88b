#pragma once

#include <functional>
#include <string>
#include <vector>

#include "capture/formats/capture_options.h"
#include "capture/formats/finding.h"
#include "capture/lens/lens.h"
#include "files/file_tree.h"
#include "scene/normalisation.h"

// What a reader finds in a capture, whatever its format: everything in the capture's own coordinates and
// units. load_capture (capture/capture.h) makes views of it.
namespace traceflow {

struct FoundView {
  std::string id;  // part of file names: without '/'
  TreeFile image;
  Lens lens;                // over lens.width × lens.height pixels; an image of another size scales it
  std::string camera_name;  // of the file and field that say the lens, for errors
  Mat3<double> camera_from_world{1};  // camera axes x right, y down, z forward
  Vec3<double> position{0};
  double time = 0;         // in any unit, at least 0
  std::string rig_camera;  // which of a rig's cameras took it; empty: not known
};

// Stored images at 1/stored of the full size, to be filtered by `factor`: stored · factor is the downscale.
struct StoredImages {
  std::string folder;
  int stored = 1;
  int factor = 1;
};

struct FoundCapture {
  std::string format;
  StoredImages images;
  std::vector<FoundView> train, test;  // whole ones alone
  bool says_times = true;              // else all are 0, as for a scene that stands still
  // As the capture lists them, those left out included: what arrays with one element per view count.
  std::vector<std::string> train_ids, all_ids;
  SceneNormalisation normalisation;
  double near_plane = 0, far_plane = 0;  // scene units; 0: not given
  std::vector<Vec3<double>> points;
  std::string points_file;                    // where they come from; empty: there are none
  Background background = Background::black;  // the format's custom, never `automatic`
  std::vector<Finding> warnings;
};

// The ids for which `exists` holds; the others become a warning: "3 of 80 training views have no image (a, b,
// c): left out". kind: of the warning. path_of: the file in which it should be; may be null.
std::vector<std::string> keep_whole(const std::vector<std::string>& ids, const std::string& split,
                                    const std::string& what,
                                    const std::function<bool(const std::string& id)>& exists,
                                    std::vector<Finding>& warnings, const std::string& kind,
                                    const std::function<std::string(const std::string& id)>& path_of);

// The folder with the largest stored images that `downscale` is a multiple of. folder_of: the folder's name
// by the scale that it is stored at. Throws InputError where there is none.
StoredImages choose_images(const FileTree& tree, int downscale,
                           const std::function<std::string(int stored)>& folder_of);

}  // namespace traceflow
