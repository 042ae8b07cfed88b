#pragma once

#include <memory>

#include "scene/motion.h"
#include "scene/surfels.h"

// Moves posed surfels of bodies (scene/motion.h) to where their bodies are at time t:
//   position R (p − c) + c + s · rotation q_R q · harmonics D(R) sh
// so that a surfel seen from a given side of its body looks the same at every time. Surfels of no body (body
// −1) are unchanged, at no cost. Differentiable: every posed value, and rotations and shifts of the motion.
// Runs on the device of the surfels, where the motion must be too.
namespace traceflow::motion {

// What forward keeps for backward. Reuse one object across iterations to keep its memory.
struct Saved;
struct SavedDeleter {
  void operator()(Saved* saved) const;
};
using SavedPtr = std::unique_ptr<Saved, SavedDeleter>;
SavedPtr make_saved();

// Moves `posed` in place. body: of the stored surfels, −1 to bodies − 1. subset: the stored surfels in
// `posed` (ascending; empty: all).
void forward(const Motion& motion, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
             PosedSurfels& posed, Saved& saved);

// Turns dL/d(moved surfels) in place into dL/d(surfels before the motion), and adds dL/dmotion to grad_motion
// (null if it is frozen). moved: forward's output. Sums in a fixed order: the same bytes at any thread count.
void backward(const Motion& motion, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
              const PosedSurfels& moved, const Saved& saved, PosedSurfels& grad_posed, Motion* grad_motion);

// Zeroes the gradient by the first key of each body. A body that grows while it moves away from the camera
// looks the same. With its first pose fixed, its initial points determine its size.
void hold_first_key(Motion& gradient);

// Zeroes the gradient by the opacities of those of the first `count` surfels that belong to a body.
void hold_opacities(const Tensor<int32_t>& body, int64_t count, Surfels& gradient);

// Convolves a gradient of `motion` in place with exp(−d²/2w²), cut off at 3w, along each body's keys, d
// apart. width: w > 0, in keys. A view's gradient reaches at most two neighbouring keys; a step against the
// convolved gradient still descends.
void spread_over_keys(const Motion& motion, float width, Motion& gradient);

// Moves stored surfels in place to where they are at a time. Not differentiable.
void move(const Motion& motion, const Tensor<int32_t>& body, float time, Surfels& surfels);

// The reference in double precision, for all surfels.
void forward_reference(const BasicMotion<double>& motion, const Tensor<int32_t>& body, double time,
                       BasicPosedSurfels<double>& posed);
// posed: the surfels before forward_reference.
void backward_reference(const BasicMotion<double>& motion, const Tensor<int32_t>& body, double time,
                        const BasicPosedSurfels<double>& posed, BasicPosedSurfels<double>& grad_posed,
                        BasicMotion<double>& grad_motion);

}  // namespace traceflow::motion
