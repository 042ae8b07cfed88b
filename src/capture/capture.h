#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/options.h"
#include "base/tensor.h"
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
};

// The pixels of a view. Tensors that the capture lacks are empty.
struct ViewImages {
  Tensor<float> colour;        // H×W×3 in [0, 1]
  Tensor<uint8_t> mask;        // H×W, 1 on the moving specular object
  Tensor<float> normal_prior;  // H×W×3, world axes, unit or zero where there is none
};

// Truth that synthetic captures carry for test views.
struct ViewTruth {
  Tensor<float> normal;  // H×W×3, world axes, unit or zero
  Tensor<float> depth;   // H×W, camera z in scene units, 0 where there is none
};

// Axes of the normal priors' camera space, as signs against OpenCV's (x right, y down, z forward): opengl + −
// −, opencv + + +, stable_normal − − −. `automatic` is opengl, unless the geometry clearly speaks for another
// (docs/captures.md).
enum class PriorAxes { automatic, opengl, opencv, stable_normal };
constexpr std::array<std::string_view, 4> enum_names(PriorAxes) {
  return {"automatic", "opengl", "opencv", "stable-normal"};
}

struct CaptureOptions {
  int downscale = 1;
  PriorAxes prior_axes = PriorAxes::automatic;
  int64_t cache_mebibytes = 1024;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("downscale", downscale, "", "Uses rgb/Kx where it exists, else box-filters rgb/1x.");
    v.field("prior_axes", prior_axes, "",
            "Axes of the normal priors: automatic, opengl (x right, y up, z to the viewer), "
            "opencv, or stable-normal (opencv negated).");
    v.field("cache_mebibytes", cache_mebibytes, "MiB", "Memory that decoded images may take.");
  }
  void validate() const;
};

class ImageCache;

struct Capture {
  std::string name;
  std::string format;  // "nerf-ds", "nerfies", "hypernerf-interp", "hypernerf-vrig"
  std::filesystem::path folder;
  std::vector<View> train;
  std::vector<View> test;
  Tensor<float> points;  // P×3, normalised scene; may be empty
  SceneNormalisation normalisation;
  float near_plane = 0;  // scene.json's, normalised scene units; 0 when absent
  float far_plane = 0;
  float extent = 1;  // 1.1 · the largest distance of a training camera from their mean (method §7.6)
  bool has_masks = false;
  bool has_normal_priors = false;
  bool has_truth = false;
  PriorAxes prior_axes = PriorAxes::opengl;  // the axes in use, never `automatic`
  std::vector<std::string> warnings;         // what looks wrong, one line each
  std::shared_ptr<ImageCache> images;
};

// Reads the folder's metadata; images are decoded when asked for. Throws InputError.
Capture load_capture(const std::filesystem::path& folder, const CaptureOptions& options);

// Decodes a view's pixels, or finds them in the cache, whose size is bounded. Safe to call from several
// threads.
std::shared_ptr<const ViewImages> load_images(const Capture& capture, const View& view);
// Decodes the views that are not in the cache, on all threads, until the cache is full. Whoever reads views
// in order calls this ahead with the next few.
void prefetch(const Capture& capture, std::span<const View> views);
ViewTruth load_truth(const Capture& capture, const View& view);

}  // namespace traceflow
