#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/options.h"
#include "base/tensor.h"
#include "math/camera.h"
#include "scene/scene.h"

// A synthetic capture with ground truth (docs/synth.md): in memory for tests, or as a folder.
namespace traceflow {

// balls: a mirror ball and a glazed ball that slide and hop, and a rotating box. mirror: a round mirror that
// turns and nods on its stand between moving boxes. tumble: a textured box and a mirroring kettle, carried
// and rotated. soft: a textured pillar that bends and stretches.
enum class SynthScene { balls, mirror, tumble, soft };
constexpr std::array<std::string_view, 4> enum_names(SynthScene) {
  return {"balls", "mirror", "tumble", "soft"};
}

struct SynthOptions {
  SynthScene scene = SynthScene::balls;
  int frames = 80;
  int width = 240;
  int height = 135;
  int64_t seed = 0;
  int samples = 16;
  int test_every = 4;
  float prior_noise = 1;
  bool depths = false;
  int points = 10000;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("scene", scene, "",
            "Scene: balls, mirror, tumble (objects turned as if by hand), or soft (an object that bends).");
    v.field("frames", frames, "frames", "Number of frames that the left (training) camera takes.");
    v.field("width", width, "pixels", "Width of the images.");
    v.field("height", height, "pixels", "Height of the images.");
    v.field("seed", seed, "", "Seed of the image noise, the errors of the priors and the points.");
    v.field("samples", samples, "paths/pixel", "Light paths per pixel.");
    v.field("test_every", test_every, "frames", "The right (test) camera takes every n-th frame.");
    v.field("prior_noise", prior_noise, "",
            "Errors of the normal priors and estimated depths: 0 for exact priors, 1 for the errors of a "
            "monocular estimator.");
    v.field(
        "depths", depths, "",
        "Also write estimates/depth: the training views' depths as an estimator of relative inverse depth "
        "gives them, for attach-priors --depth.");
    v.field("points", points, "points", "Number of surface points at time 0.");
  }
  void validate() const;
};

// One image's time and camera. The camera is in the capture's own world (metres, z up).
struct SynthView {
  std::string id;   // 000012_left, 000012_right
  int frame = 0;    // time_id
  double time = 0;  // in [0, 1]
  bool is_test = false;
  Camera<double> camera;
};

// All views in frame order, left before right.
std::vector<SynthView> synth_views(const SynthOptions& options);

// A view's pixels. colour = diffuse + specular, clipped to [0, 1]: diffuse is the first surface's own light,
// specular is what it mirrors, both weighted. Masks show the mirroring bodies of balls and mirror, and the
// moving objects of tumble and soft.
struct SynthImages {
  Tensor<float> colour, diffuse, specular;  // H×W×3
  Tensor<uint8_t> mask;                     // H×W, 1 if a masked body is at the pixel's centre
  Tensor<float> normal;                     // H×W×3, world axes, unit, at pixel centres
  Tensor<float> depth;                      // H×W, camera z at pixel centres
};
SynthImages synth_images(const SynthOptions& options, const SynthView& view);

// A view's normals with errors like those of a monocular estimator: blurred, rotated, and warped slowly over
// the image. H×W×3 in the camera space of normal priors (x right, y up, z to the viewer), unit.
Tensor<float> synth_normal_prior(const SynthOptions& options, const SynthView& view,
                                 const Tensor<float>& normal);

// A view's depths (H×W) as an estimator of relative inverse depth gives them: inverse depth, blurred and with
// an error that varies slowly over the image by up to 4 %, scaled so that it covers [0, 1]. H×W.
Tensor<float> synth_inverse_depth(const SynthOptions& options, const SynthView& view,
                                  const Tensor<float>& depth);

// Noisy points, P×3 in world, on the surfaces at time 0 that the left camera sees from anywhere on its path.
Tensor<float> synth_points(const SynthOptions& options);

// World positions of points on the moving objects at every time. The points are those that the first training
// camera sees at time 0, at most 600 per object, on a grid that does not depend on the image size. Bodies
// that move together are one object. Static bodies are excluded.
struct SynthMotion {
  Tensor<float> points;    // T×N×3, entry i at the time of frame i
  Tensor<int32_t> object;  // N, 0, 1, …
};
SynthMotion synth_motion(const SynthOptions& options);

// The normalisation in the capture's scene.json, and the depth range in the normalised scene.
SceneNormalisation synth_normalisation();
inline constexpr double synth_near = 0.05;
inline constexpr double synth_far = 4.0;

// Writes the capture in the NeRF-DS layout with priors, points and truth. Accepts an absent or empty folder
// or an earlier synthetic capture, which is replaced. Any other folder throws InputError. dataset.json is
// written last and marks a complete folder.
void write_synthetic_capture(const SynthOptions& options, const std::filesystem::path& folder);

}  // namespace traceflow
