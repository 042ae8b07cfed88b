#pragma once

#include <functional>
#include <string>
#include <vector>

#include "capture/formats/capture_options.h"
#include "capture/formats/finding.h"
#include "capture/lens/lens.h"
#include "files/file_tree.h"
#include "scene/normalisation.h"

// What a reader finds in a capture of any format, in the capture's own coordinates and units. load_capture
// (capture/capture.h) makes views of it.
namespace traceflow {

struct FoundView {
  std::string id;  // becomes part of file names: no '/'
  TreeFile image;
  Lens lens;                // for lens.width × lens.height pixels; scaled if the image has another size
  std::string camera_name;  // the file and field that define the lens, for errors
  Mat3<double> camera_from_world{1};  // camera axes x right, y down, z forward
  Vec3<double> position{0};
  double time = 0;         // in any unit, with any origin
  std::string rig_camera;  // the camera of a rig that took the view; empty: unknown
};

// Stored images at 1/stored of the full size, to be filtered by `factor`. The downscale is stored · factor.
struct StoredImages {
  std::string folder;  // may contain one folder for each camera of a rig
  int stored = 1;
  int factor = 1;
};

struct FoundCapture {
  std::string format;
  StoredImages images;
  std::vector<FoundView> train, test;  // complete views only
  // The source of times that the format defines; `automatic`: the views' own times. As returned by
  // read_capture: the source that was used.
  CaptureTimes times = CaptureTimes::automatic;
  // In the order of the capture's lists, including views that were left out. Arrays have one element per id
  // here.
  std::vector<std::string> train_ids, all_ids;
  // Paths, without extension, of all images that the capture names, including those left out.
  std::vector<std::string> listed_images;
  SceneNormalisation normalisation;
  double near_plane = 0, far_plane = 0;  // scene units; 0: not given
  std::vector<Vec3<double>> points;
  std::string points_file;                    // the file with the points; empty: no points
  Background background = Background::black;  // the format's default, never `automatic`
  bool transparent_is_unknown = false;        // likewise: transparent pixels are not part of a photograph
  std::vector<Finding> warnings;
};

// Returns the ids for which `exists` holds. The others cause a warning: "3 of 80 training views have no image
// (a, b, c): left out". kind: of the warning. path_of: the expected file; may be null.
std::vector<std::string> keep_whole(const std::vector<std::string>& ids, const std::string& split,
                                    const std::string& what,
                                    const std::function<bool(const std::string& id)>& exists,
                                    std::vector<Finding>& warnings, const std::string& kind,
                                    const std::function<std::string(const std::string& id)>& path_of);

// Functions of the scale of stored images.
using IsStored = std::function<bool(int stored)>;
using StoredFolder = std::function<std::string(int stored)>;

// The largest scale of stored images that divides `downscale`; 0 if there is none.
int fitting_scale(int downscale, const IsStored& is_stored);
// All scales at which images are stored.
std::vector<int> stored_scales(const IsStored& is_stored);
// The images at the fitting scale. If there is none, throws InputError with `where` and the existing folders.
StoredImages choose_images(const std::string& where, int downscale, const IsStored& is_stored,
                           const StoredFolder& folder_of);

}  // namespace traceflow
