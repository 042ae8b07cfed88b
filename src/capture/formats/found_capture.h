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
  double time = 0;         // in any unit, from any beginning
  std::string rig_camera;  // which of a rig's cameras took it; empty: not known
};

// Stored images at 1/stored of the full size, to be filtered by `factor`: stored · factor is the downscale.
struct StoredImages {
  std::string folder;  // which may hold one for each camera of a rig
  int stored = 1;
  int factor = 1;
};

struct FoundCapture {
  std::string format;
  StoredImages images;
  std::vector<FoundView> train, test;  // whole ones alone
  // Where times come from by the format's custom; `automatic`: as the views have them. Of what read_capture
  // returns: where they came from.
  CaptureTimes times = CaptureTimes::automatic;
  // As the capture lists them, those left out included: what arrays with one element per view count.
  std::vector<std::string> train_ids, all_ids;
  // Paths, without extension, of all images that the capture names, those left out included.
  std::vector<std::string> listed_images;
  SceneNormalisation normalisation;
  double near_plane = 0, far_plane = 0;  // scene units; 0: not given
  std::vector<Vec3<double>> points;
  std::string points_file;                    // where they come from; empty: there are none
  Background background = Background::black;  // the format's custom, never `automatic`
  bool transparent_is_unknown = false;        // likewise: transparent pixels are no part of a photograph
  std::vector<Finding> warnings;
};

// The ids for which `exists` holds; the others become a warning: "3 of 80 training views have no image (a, b,
// c): left out". kind: of the warning. path_of: the file in which it should be; may be null.
std::vector<std::string> keep_whole(const std::vector<std::string>& ids, const std::string& split,
                                    const std::string& what,
                                    const std::function<bool(const std::string& id)>& exists,
                                    std::vector<Finding>& warnings, const std::string& kind,
                                    const std::function<std::string(const std::string& id)>& path_of);

// By the scale that images are stored at.
using IsStored = std::function<bool(int stored)>;
using StoredFolder = std::function<std::string(int stored)>;

// The largest scale of stored images that `downscale` is a multiple of; 0 where there is none.
int fitting_scale(int downscale, const IsStored& is_stored);
// The scales at which images are stored, whether one wants them or not.
std::vector<int> stored_scales(const IsStored& is_stored);
// The images at the fitting scale. Throws InputError naming `where`, and the folders that there are, where
// there is none.
StoredImages choose_images(const std::string& where, int downscale, const IsStored& is_stored,
                           const StoredFolder& folder_of);

}  // namespace traceflow
