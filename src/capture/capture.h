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

// What the camera saw: views of one moving scene, read from a capture folder (docs/captures.md).
namespace traceflow {

// One photograph and where, when and how it was taken. The camera is in the normalised scene (method §2), of
// the size that the image is trained at, without distortion or skew.
struct View {
  std::string id;
  float time = 0;  // in [0, 1]
  Camera<float> camera;
  // Rotates normal priors in the mask (world axes), to undo their bias; none while the bias is not known.
  std::optional<Mat3<float>> prior_turn = {};
};

// The pixels of a view. Tensors that the capture lacks are empty.
struct ViewImages {
  Tensor<float> colour;        // H×W×3 in [0, 1]
  Tensor<uint8_t> known;       // H×W, 1 where the colour says something; empty where it does everywhere
  Tensor<uint8_t> mask;        // H×W, 1 on the moving specular object
  Tensor<float> coverage;      // H×W in [0, 1], how much of a pixel the mask covers; empty without one
  Tensor<float> normal_prior;  // H×W×3, world axes, unit or zero where there is none
};

// Truth that synthetic captures carry for test views.
struct ViewTruth {
  Tensor<float> normal;  // H×W×3, world axes, unit or zero
  Tensor<float> depth;   // H×W, camera z in scene units, 0 where there is none
};

class ImageCache;

struct Capture {
  std::string name;
  std::string format;            // docs/captures.md has the names
  std::filesystem::path folder;  // or archive
  std::vector<View> train;
  std::vector<View> test;
  Tensor<float> points;  // P×3, normalised scene; may be empty
  // Of the points those that training saw to stand still (train/found_masks.h); empty where it did not look.
  Tensor<float> standing_points;
  PointTracks tracks;  // may be empty
  SceneNormalisation normalisation;
  float near_plane = 0;  // scene.json's, normalised scene units; 0 when absent
  float far_plane = 0;
  float extent = 1;  // 1.1 · the largest distance of a training camera from their mean (method §7.6)
  bool has_masks = false;
  bool masks_are_estimated = false;  // they show, coarsely and in parts, what moves, be it shiny or not
  // No masks but those that training found, of what moves, be it shiny or not (train/found_masks.h).
  bool masks_are_found = false;
  int64_t found_masks = 0;  // that training found and gave to views
  bool has_normal_priors = false;
  bool has_truth = false;
  PriorAxes prior_axes = PriorAxes::opengl;  // the axes in use, never `automatic`
  std::vector<Finding> warnings;             // what looks wrong
  std::shared_ptr<ImageCache> images;
};

// Reads what a folder or a zip archive says about its views; images are decoded when asked for. Throws
// InputError.
Capture load_capture(const std::filesystem::path& path, const CaptureOptions& options);

// Every time at which it has a view of either split, ascending.
std::vector<float> times_of(const Capture& capture);

// Decodes a view's pixels, or finds them in the cache, whose size is bounded; priors are turned as the view
// says. Safe to call from several threads.
std::shared_ptr<const ViewImages> load_images(const Capture& capture, const View& view);
// Decodes the views that are not in the cache, on all threads, until the cache is full. Whoever reads views
// in order calls this ahead with the next few.
void prefetch(const Capture& capture, std::span<const View> views);
// A photograph by itself, as finely as it is stored but at most `widest` pixels wide, and never more coarsely
// than the view.
struct FinePhotograph {
  Camera<float> camera;
  Tensor<float> colour;    // H×W×3 in [0, 1]
  Tensor<float> coverage;  // H×W in [0, 1], how much of a pixel the mask covers; empty without one
};
// Decodes it; the cache is not used.
FinePhotograph load_fine_photograph(const Capture& capture, const View& view, int64_t widest);
ViewTruth load_truth(const Capture& capture, const View& view);

}  // namespace traceflow
