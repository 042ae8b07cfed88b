#include "ops/motion/motion.h"

#include <utility>

#include "base/parallel.h"
#include "ops/motion/motion_kernels.h"
#include "primitives/sums.h"

namespace traceflow::motion {

struct Saved {
  Tensor<PosedBody> bodies;
};
void SavedDeleter::operator()(Saved* saved) const { delete saved; }
SavedPtr make_saved() { return SavedPtr(new Saved); }

namespace {

void pose_bodies(const Motion& motion, float time, Tensor<PosedBody>& bodies) {
  bodies.place(motion.device()).resize({motion.bodies()});
  parallel_for(motion.device(), "motion: pose bodies", motion.bodies(),
               PoseBody{motion.time.data(), motion.centre.data(), motion.rotation.data(), motion.shift.data(),
                        motion.keys(), double{time}, bodies.data()},
               1);
}

CarrierOf carrier_of(const Tensor<int32_t>& body, const Tensor<int32_t>& subset) {
  return {body.data(), subset.empty() ? nullptr : subset.data()};
}

void keep_generators(Device device, Tensor<ShRotation<float>>& kept) {
  if (!kept.empty() && kept.device() == device) return;
  Tensor<ShRotation<float>> generators({3});
  for (int axis = 0; axis < 3; ++axis) {
    Vec3<double> about(0);
    about[axis] = 1;
    generators[axis] = sh_generator<float>(about);
  }
  kept = generators.on(device);
}

}  // namespace

void forward(const Motion& motion, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
             PosedSurfels& posed, Saved& saved) {
  pose_bodies(motion, time, saved.bodies);
  if (body.empty() || posed.count() == 0) return;
  const MutablePosedSurfelsView to = view_of(posed);
  parallel_for(posed.device(), "motion: move", posed.count(),
               MoveSurfel{carrier_of(body, subset), saved.bodies.data(), to.position, to.rotation, to.sh,
                          to.sh_row, to.sh_degree});
}

void backward(const Motion& motion, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
              const PosedSurfels& moved, const Saved& saved, PosedSurfels& grad_posed, Motion* grad_motion) {
  if (body.empty() || moved.count() == 0) return;
  const Device device = moved.device();
  const CarrierOf carrier = carrier_of(body, subset);
  const PosedBody* const bodies = saved.bodies.data();
  if (grad_motion != nullptr) {
    static thread_local Tensor<PoseGradient> gradients;
    static thread_local Tensor<ShRotation<float>> generators;
    keep_generators(device, generators);
    gradients.place(device).resize({motion.bodies()});
    for (int64_t b = 0; b < motion.bodies(); ++b) {
      ordered_sum<PoseGradient>(
          device, "motion: pose gradient", moved.count(),
          PoseGradientOfSurfel{carrier, static_cast<int32_t>(b), bodies, generators.data(), view_of(moved),
                               view_of(static_cast<const PosedSurfels&>(grad_posed))},
          StoreSum<PoseGradient>{gradients.data() + b}, 1024);
    }
    parallel_for(device, "motion: add to keys", motion.bodies(),
                 AddToKeys{gradients.data(), motion.time.data(), motion.rotation.data(), motion.keys(),
                           double{time}, grad_motion->rotation.data(), grad_motion->shift.data()});
  }
  const MutablePosedSurfelsView to = view_of(grad_posed);
  parallel_for(device, "motion: turn gradients back", moved.count(),
               TurnGradientBack{carrier, bodies, to.position, to.rotation, to.sh, to.sh_row, to.sh_degree});
}

void hold_first_key(Motion& gradient) {
  parallel_for(gradient.device(), "motion: hold the first key", gradient.bodies(),
               HoldFirstKey{gradient.keys(), gradient.rotation.data(), gradient.shift.data()});
}

void hold_opacities(const Tensor<int32_t>& body, int64_t count, Surfels& gradient) {
  parallel_for(gradient.device(), "motion: hold opacities", count,
               HoldOpacity{body.data(), gradient.opacity_logit.data()});
}

void spread_over_keys(const Motion& motion, float width, Motion& gradient) {
  static thread_local Tensor<float> spread;
  for (Tensor<float>* const numbers : {&gradient.rotation, &gradient.shift}) {
    spread.place(gradient.device()).resize(numbers->shape());
    const float* const rotation = numbers == &gradient.rotation ? motion.rotation.data() : nullptr;
    parallel_for(
        gradient.device(), "motion: spread over keys", gradient.bodies() * gradient.keys(),
        SpreadOverKeys{numbers->data(), rotation, gradient.keys(), numbers->dim(2), width, spread.data()});
    std::swap(*numbers, spread);
  }
}

void move(const Motion& motion, const Tensor<int32_t>& body, float time, Surfels& surfels) {
  if (body.empty() || surfels.count() == 0) return;
  Tensor<PosedBody> bodies;
  pose_bodies(motion, time, bodies);
  parallel_for(
      surfels.device(), "motion: move", surfels.count(),
      MoveSurfel{carrier_of(body, {}), bodies.data(), surfels.position.data(), surfels.rotation.data(),
                 surfels.sh.data(), surfels.sh.row_size(), sh_degree(surfels.sh.dim(1))});
}

}  // namespace traceflow::motion
