#include "ops/motion/nodes.h"

#include "base/parallel.h"
#include "ops/motion/nodes_kernels.h"
#include "primitives/sums.h"

namespace traceflow::nodes {

struct Saved {
  Tensor<PosedNode> nodes;
  Tensor<float> weights;  // N×M
  Tensor<RestSurfel> rest;
  // Working memory of backward.
  Tensor<Vec3<float>> turns;
  Tensor<NodeGradient> gradients;
};
void SavedDeleter::operator()(Saved* saved) const { delete saved; }
SavedPtr make_saved() { return SavedPtr(new Saved); }

namespace {

void run(const Nodes& nodes, const CarrierOf& carrier, float time, int64_t count, float* position,
         float* rotation, Saved& saved) {
  const Device device = nodes.device();
  saved.nodes.place(device).resize({nodes.count()});
  saved.weights.place(device).resize({nodes.count(), count});
  saved.rest.place(device).resize({count});
  parallel_for(
      device, "nodes: pose", nodes.count(),
      PoseNode{nodes.body.data(), nodes.time.data(), nodes.centre.data(), nodes.radius.data(),
               nodes.turn.data(), nodes.shift.data(), nodes.times(), double{time}, saved.nodes.data()},
      1);
  parallel_for(device, "nodes: bend", count,
               BendSurfel{carrier, saved.nodes.data(), nodes.count(), count, position, rotation,
                          saved.weights.data(), saved.rest.data()});
}

CarrierOf carrier_of(const Tensor<int32_t>& body, const Tensor<int32_t>& subset) {
  return {body.data(), subset.empty() ? nullptr : subset.data()};
}

}  // namespace

void forward(const Nodes& nodes, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
             PosedSurfels& posed, Saved& saved) {
  if (body.empty() || posed.count() == 0 || nodes.count() == 0) return;
  run(nodes, carrier_of(body, subset), time, posed.count(), posed.position.data(), posed.rotation.data(),
      saved);
}

void backward(const Nodes& nodes, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
              Saved& saved, PosedSurfels& grad_posed, Nodes* grad_nodes) {
  const int64_t count = grad_posed.count();
  if (body.empty() || count == 0 || nodes.count() == 0) return;
  require(saved.rest.size() == count, "backward follows forward of the same surfels",
          std::to_string(subset.size()));
  const Device device = nodes.device();
  saved.turns.place(device).resize({count});
  parallel_for(device, "nodes: turn gradient", count,
               TurnGradient{saved.rest.data(), grad_posed.rotation.data(), saved.turns.data()});
  if (grad_nodes != nullptr) {
    saved.gradients.place(device).resize({nodes.count()});
    for (int64_t n = 0; n < nodes.count(); ++n) {
      ordered_sum<NodeGradient>(
          device, "nodes: node gradient", count,
          NodeGradientOfSurfel{saved.nodes.data() + n, saved.weights.data() + n * count, saved.rest.data(),
                               saved.turns.data(), grad_posed.position.data()},
          StoreSum<NodeGradient>{saved.gradients.data() + n}, 4096);
    }
    parallel_for(device, "nodes: add to keys", nodes.count(),
                 AddToKeys{saved.gradients.data(), saved.nodes.data(), nodes.time.data(), nodes.times(),
                           double{time}, grad_nodes->turn.data(), grad_nodes->shift.data()});
  }
  parallel_for(
      device, "nodes: bend gradients back", count,
      BendGradientBack{saved.nodes.data(), nodes.count(), count, saved.weights.data(), saved.rest.data(),
                       saved.turns.data(), grad_posed.position.data(), grad_posed.rotation.data()});
}

void bend(const Nodes& nodes, const Tensor<int32_t>& body, float time, Surfels& surfels) {
  if (body.empty() || surfels.count() == 0 || nodes.count() == 0) return;
  Saved saved;
  run(nodes, carrier_of(body, {}), time, surfels.count(), surfels.position.data(), surfels.rotation.data(),
      saved);
}

namespace {
BodyPoses poses_of(const Motion& motion) {
  return {motion.time.data(), motion.centre.data(), motion.rotation.data(), motion.shift.data(),
          motion.keys()};
}
}  // namespace

void resist(const Nodes& nodes, const Motion& motion, const Stiffness& weights, Nodes& gradient) {
  const Resistance of{poses_of(motion),
                      nodes.body.data(),
                      nodes.time.data(),
                      nodes.centre.data(),
                      nodes.radius.data(),
                      nodes.turn.data(),
                      nodes.shift.data(),
                      nodes.anchor.data(),
                      nodes.count(),
                      nodes.times(),
                      weights};
  parallel_for(nodes.device(), "nodes: resist", nodes.count() * nodes.times(),
               ResistanceGradient{of, gradient.turn.data(), gradient.shift.data()}, 16);
}

Vec3<double> place_of(const Nodes& nodes, const Motion& motion, int64_t n, int64_t k) {
  return poses_of(motion).at(nodes.body[n], nodes.time[k])(load3<double>(nodes.centre.row(n)) +
                                                           load3<double>(&nodes.shift(n, k, 0)));
}

void hold_first(Nodes& gradient) {
  parallel_for(gradient.device(), "nodes: hold the first time", gradient.count(),
               HoldFirst{gradient.times(), gradient.turn.data(), gradient.shift.data()});
}

}  // namespace traceflow::nodes
