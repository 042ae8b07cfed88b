#pragma once

#include <array>
#include <vector>

#include "capture/capture.h"
#include "files/safetensors.h"
#include "math/camera.h"
#include "ops/optimize/adam.h"

// Poses of training cameras that are slightly wrong: refined by the gradient of the loss (rates.camera; not
// in the paper).
namespace traceflow {

// dL/d(turn, shift) of a camera at its pose: a turn about its centre, a rotation vector in world axes, and a
// shift of its centre in world.
std::array<double, 6> pose_gradient(const Camera<float>& camera, const CameraGradient<float>& gradient);

// The camera with its centre shifted and turned about that.
Camera<float> moved(const Camera<float>& camera, const Vec3<double>& turn, const Vec3<double>& shift);

// What has been found of a capture's training cameras. V×3 each, or both empty where they are as given.
struct CameraCorrections {
  Tensor<double> turn;   // rotation vectors in world axes
  Tensor<double> shift;  // of centres in world, scene units

  bool empty() const { return turn.empty(); }
  // The camera of a view as the capture gives it, corrected. Throws InputError where there are fewer views.
  Camera<float> applied(const Camera<float>& given, int64_t view) const;
};

// Those of a checkpoint; empty where it has none. Throws InputError where they cannot be any.
CameraCorrections corrections_in(const Safetensors& checkpoint);

// A turn and a shift that follow gradients by Adam, each step a turn from the left of the ones before.
struct CameraSteps {
  optimize::AdamState moments;

  // rate: radians; shifts take rate · length. Entries of the gradient that are not finite change nothing.
  void step(const std::array<double, 6>& gradient, double rate, double length,
            const optimize::AdamOptions& adam, Vec3<double>& turn, Vec3<double>& shift);
};

// The training cameras of a run and their corrections. The corrections hold no similarity transform of all
// cameras together, to first order: such a one changes no picture once the scene has followed it, and would
// take the scene away from the held-out cameras.
class CameraRefinement {
 public:
  explicit CameraRefinement(const std::vector<View>& given);

  // One step of one view's camera: `gradient` is dL/d(its pose). length: of the scene, which a turn of one
  // radian is compared with. Changes all cameras a little.
  void step(int64_t view, const CameraGradient<float>& gradient, double rate, double length,
            const optimize::AdamOptions& adam);
  Camera<float> camera(int64_t view) const;
  const CameraCorrections& corrections() const { return corrections_; }
  // Whether any step has been made.
  bool is_begun() const { return begun_; }

  void put(Safetensors& checkpoint) const;
  // Takes over what a checkpoint holds, where it holds anything. Throws InputError where it does not fit.
  void get(const Safetensors& checkpoint);

 private:
  // Takes the similarity transform that fits the corrections best out of them.
  void leave_out_similarity();

  std::vector<Camera<float>> given_;
  CameraCorrections corrections_;
  std::vector<CameraSteps> steps_;
  bool begun_ = false;
};

}  // namespace traceflow
