#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/tensor.h"
#include "capture/formats/capture_options.h"
#include "capture/formats/finding.h"
#include "capture/point_tracks.h"
#include "math/camera.h"
#include "scene/scene.h"

// What the camera saw: views of one moving scene, read from a capture (docs/captures.md).
namespace traceflow {

// One photograph with its camera and time. The camera is in the normalised scene (method §2), has the size of
// the training image, and has no distortion or skew.
struct View {
  std::string id;
  float time = 0;  // in [0, 1]
  Camera<float> camera;
  // Rotates normal priors in the mask (world axes) to undo their bias; empty while the bias is unknown.
  std::optional<Mat3<float>> prior_turn = {};
};

// The pixels of a view. Tensors that the capture lacks are empty.
struct ViewImages {
  Tensor<float> colour;        // H×W×3 in [0, 1]
  Tensor<uint8_t> known;       // H×W, 1 where the colour is known; empty if it is known everywhere
  Tensor<uint8_t> mask;        // H×W, 1 on the moving specular object
  Tensor<float> coverage;      // H×W in [0, 1], fraction that the mask covers; empty without a mask
  Tensor<float> normal_prior;  // H×W×3, world axes, unit or zero (no prior)
  Tensor<float> depth_prior;   // H×W, camera z in scene units, 0 if unknown
};

// Ground truth that synthetic captures have for test views.
struct ViewTruth {
  Tensor<float> normal;  // H×W×3, world axes, unit or zero
  Tensor<float> depth;   // H×W, camera z in scene units, 0 if unknown
};

class ImageCache;

struct Capture {
  std::string name;
  std::string format;            // see docs/captures.md
  std::filesystem::path folder;  // or archive
  std::vector<View> train;
  std::vector<View> test;
  Tensor<float> points;  // P×3, normalised scene; may be empty
  // Those of the points that training found to be static (train/found_masks.h); empty if it did not look.
  Tensor<float> standing_points;
  PointTracks tracks;  // may be empty
  SceneNormalisation normalisation;
  float near_plane = 0;  // of scene.json, normalised scene units; 0 if absent
  float far_plane = 0;
  float extent = 1;  // 1.1 · the largest distance of a training camera from the mean of all (method §7.6)
  bool has_masks = false;
  bool masks_are_estimated = false;  // the masks show coarsely, and in part, what moves, shiny or not
  // The only masks are those that training found. They show what moves, shiny or not (train/found_masks.h).
  bool masks_are_found = false;
  int64_t found_masks = 0;  // number of masks that training found and gave to views
  bool has_normal_priors = false;
  bool has_depth_priors = false;
  bool has_truth = false;
  PriorAxes prior_axes = PriorAxes::opengl;  // the axes in use, never `automatic`
  std::vector<Finding> warnings;             // what looks wrong
  std::shared_ptr<ImageCache> images;
};

// Reads the views of a folder or a zip archive. Images are decoded on demand. Throws InputError.
Capture load_capture(const std::filesystem::path& path, const CaptureOptions& options);

// The times of all views of both splits, ascending, each once.
std::vector<float> times_of(const Capture& capture);

// Returns a view's pixels, from a cache of bounded size or decoded. Applies the view's prior_turn. Safe to
// call from several threads.
std::shared_ptr<const ViewImages> load_images(const Capture& capture, const View& view);
// Decodes the views that are not in the cache, on all threads, until the cache is full. Code that reads views
// in order calls this with the next few.
void prefetch(const Capture& capture, std::span<const View> views);
// One photograph at its stored resolution, but at most `widest` pixels wide and never coarser than the view.
struct FinePhotograph {
  Camera<float> camera;
  Tensor<float> colour;    // H×W×3 in [0, 1]
  Tensor<float> coverage;  // H×W in [0, 1], how much of a pixel the mask covers; empty without one
};
// Decodes the photograph without the cache.
FinePhotograph load_fine_photograph(const Capture& capture, const View& view, int64_t widest);
ViewTruth load_truth(const Capture& capture, const View& view);

}  // namespace traceflow
