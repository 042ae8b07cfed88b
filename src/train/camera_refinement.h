#pragma once

#include <array>
#include <vector>

#include "capture/capture.h"
#include "files/safetensors.h"
#include "math/camera.h"
#include "ops/optimize/adam.h"

// Refines slightly wrong poses of training cameras by the gradient of the loss (rates.camera; not in the
// paper).
namespace traceflow {

// dL/d(turn, shift) of a camera at its pose. turn: rotation vector in world axes, about the camera's centre.
// shift: translation of the centre in world axes.
std::array<double, 6> pose_gradient(const Camera<float>& camera, const CameraGradient<float>& gradient);

// The camera after moving its centre by shift and rotating it by turn about its centre.
Camera<float> moved(const Camera<float>& camera, const Vec3<double>& turn, const Vec3<double>& shift);

// The corrections of a capture's training cameras: V×3 each, or both empty if the cameras are as given.
struct CameraCorrections {
  Tensor<double> turn;   // rotation vectors in world axes
  Tensor<double> shift;  // of centres, world axes, scene units

  bool empty() const { return turn.empty(); }
  // The corrected camera of a view; `given` is the camera from the capture. Throws InputError when there are
  // fewer views.
  Camera<float> applied(const Camera<float>& given, int64_t view) const;
};

// The corrections in a checkpoint; empty if it has none. Throws InputError when they are not valid.
CameraCorrections corrections_in(const Safetensors& checkpoint);

// Adam on a rotation vector and a translation. Each step multiplies its rotation from the left.
struct CameraSteps {
  optimize::AdamState moments;

  // rate: radians; translations use rate · length. Entries of the gradient that are not finite change
  // nothing.
  void step(const std::array<double, 6>& gradient, double rate, double length,
            const optimize::AdamOptions& adam, Vec3<double>& turn, Vec3<double>& shift);
};

// The training cameras of a run and their corrections. To first order the corrections contain no similarity
// transform common to all cameras. Such a transform would change no image once the scene has followed it, but
// would move the scene away from the held-out cameras.
class CameraRefinement {
 public:
  explicit CameraRefinement(const std::vector<View>& given);

  // One step for the camera of one view; `gradient` is dL/d(its pose). `length` is the scene's length that
  // corresponds to a rotation of one radian. Changes all cameras a little, because the common similarity is
  // removed. If memory runs out, nothing has changed.
  void step(int64_t view, const CameraGradient<float>& gradient, double rate, double length,
            const optimize::AdamOptions& adam);
  Camera<float> camera(int64_t view) const;
  const CameraCorrections& corrections() const { return corrections_; }
  // Whether any step has been made.
  bool is_begun() const { return begun_; }

  void put(Safetensors& checkpoint) const;
  // Reads the state from a checkpoint, if it has any. Throws InputError when it does not fit.
  void get(const Safetensors& checkpoint);

 private:
  // Removes from the corrections the similarity transform that fits them best.
  void leave_out_similarity();

  std::vector<Camera<float>> given_;
  CameraCorrections corrections_;
  std::vector<CameraSteps> steps_;
  bool begun_ = false;
};

}  // namespace traceflow
