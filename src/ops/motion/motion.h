#pragma once

#include <memory>

#include "scene/motion.h"
#include "scene/surfels.h"

// Posed surfels that bodies carry (scene/motion.h), moved to where their bodies are at time t:
//   position R (p − c) + c + s · rotation q_R q · harmonics D(R) sh, so that what a surfel looks like from a
//   side of its body is the same at every time.
// Surfels of no body (body −1) stay as they are, at no cost. Differentiable: every posed value, and rotations
// and shifts of the motion. Runs where the surfels are; the motion is there too.
namespace traceflow::motion {

// What forward keeps for backward. Reuse one object across iterations: its memory is kept.
struct Saved;
struct SavedDeleter {
  void operator()(Saved* saved) const;
};
using SavedPtr = std::unique_ptr<Saved, SavedDeleter>;
SavedPtr make_saved();

// Moves `posed` in place. body: of the stored surfels, −1 to bodies − 1. subset: which stored ones `posed`
// are (ascending; empty means all).
void forward(const Motion& motion, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
             PosedSurfels& posed, Saved& saved);

// Turns dL/d(moved surfels) in place into dL/d(surfels as they were), and adds dL/dmotion to grad_motion
// (null where it is frozen). moved: forward's output. Sums in a fixed order: the same bytes at any thread
// count.
void backward(const Motion& motion, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
              const PosedSurfels& moved, const Saved& saved, PosedSurfels& grad_posed, Motion* grad_motion);

// Zeroes the gradient by the first key of each body. A body that grows and goes away from the camera looks
// the same; the points that it began with say how large it is as long as its first pose stands.
void hold_first_key(Motion& gradient);

// Zeroes the gradient by the opacities of those of the first `count` surfels that a body carries.
void hold_opacities(const Tensor<int32_t>& body, int64_t count, Surfels& gradient);

// Convolves a gradient of `motion` in place with exp(−d²/2w²), cut off at 3w, along each body's keys, d
// apart; width w > 0, in keys. A view's gradient is by at most two neighbouring keys, so that a step against
// the spread one still goes downhill.
void spread_over_keys(const Motion& motion, float width, Motion& gradient);

// Moves stored surfels in place to where they are at a time. Not differentiable.
void move(const Motion& motion, const Tensor<int32_t>& body, float time, Surfels& surfels);

// The plain truth in double precision, of all surfels.
void forward_reference(const BasicMotion<double>& motion, const Tensor<int32_t>& body, double time,
                       BasicPosedSurfels<double>& posed);
// posed: as they were before forward_reference.
void backward_reference(const BasicMotion<double>& motion, const Tensor<int32_t>& body, double time,
                        const BasicPosedSurfels<double>& posed, BasicPosedSurfels<double>& grad_posed,
                        BasicMotion<double>& grad_motion);

}  // namespace traceflow::motion
