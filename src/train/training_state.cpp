#include "train/training_state.h"

#include <numeric>

#include "track/prior_bias.h"

namespace traceflow {

ViewOrder::ViewOrder(int64_t views) : order_({views}), next_(views) {
  std::iota(order_.values().begin(), order_.values().end(), 0);
}

int32_t ViewOrder::draw(Random& random) {
  if (next_ >= order_.size()) {
    for (int64_t i = order_.size() - 1; i > 0; --i) std::swap(order_[i], order_[random.below(i + 1)]);
    next_ = 0;
  }
  return order_[next_++];
}

void ViewOrder::set_state(Tensor<int32_t> order, int64_t next) {
  bool fits = order.size() == order_.size() && next >= 0 && next <= order_.size();
  for (const int32_t view : order.values()) fits = fits && view >= 0 && view < order_.size();
  if (!fits) {
    throw InputError("checkpoint", "views", std::to_string(order.size()) + " views",
                     std::to_string(order_.size()), "resume with the capture that the run was started with");
  }
  order_ = std::move(order);
  next_ = next;
}

TrainingState::TrainingState(const TrainOptions& options, const Capture& capture, Scene start)
    : scene(std::move(start)),
      optimiser(scene),
      main_density("main", options.density, scene.main.count(), scene.device()),
      environment_density("environment", options.environment_density, scene.environment.count(),
                          scene.device()),
      cameras(capture.train),
      views(static_cast<int64_t>(capture.train.size())),
      divergence(options.non_finite, options.collapse_decibels) {
  for (const View& view : capture.train) given_prior_turns_.push_back(view.prior_turn);
}

void TrainingState::begin_iteration(bool solves_poses) {
  before_.reset();
  Copies copies{random, views, divergence, bodies, {}, {}, {}, {}};
  if (solves_poses) {
    copies.motion = scene.main_motion;
    copies.nodes = scene.main_nodes;
    copies.lighting = scene.lighting;
    copies.main = scene.main;
  }
  before_ = std::move(copies);
}

void TrainingState::end_iteration() {
  ++iteration;
  before_.reset();
}

void TrainingState::roll_back() {
  if (!before_) return;
  random = before_->random;
  views = std::move(before_->views);
  divergence = before_->divergence;
  bodies = std::move(before_->bodies);
  if (before_->main) {
    // If the iteration added a body, the moments would not fit a checkpoint without it.
    if (scene.main_motion->bodies() != before_->motion->bodies()) optimiser.begin(*before_->motion);
    scene.main_motion = std::move(before_->motion);
    scene.main_nodes = std::move(before_->nodes);
    scene.lighting = std::move(before_->lighting);
    scene.main = std::move(*before_->main);
  }
  before_.reset();
}

void TrainingState::apply_to(std::vector<View>& train) const {
  for (size_t i = 0; i < train.size(); ++i) {
    View& view = train[i];
    if (cameras.is_begun()) view.camera = cameras.camera(static_cast<int64_t>(i));
    view.prior_turn = given_prior_turns_[i];
    if (bodies.prior_bias) view.prior_turn = inverse_of_bias(view.camera, *bodies.prior_bias);
  }
}

}  // namespace traceflow
