#include "train/trainer.h"

#include <cmath>
#include <system_error>

#include "base/clock.h"
#include "base/options.h"
#include "base/parallel.h"
#include "base/version.h"
#include "ops/lighting/lighting.h"
#include "ops/motion/motion.h"
#include "render/frame_kernels.h"
#include "train/continuation.h"
#include "train/initialise.h"
#include "train/odd_masks.h"

namespace traceflow {

namespace {

// Every fourth of a surfel's 32 nearest neighbours: enough to keep a shape, and far enough to suppress
// wrinkles.
constexpr int bond_stride = 4;
// Relative to the rates, suggested after a collapse. It saved a video of 8,000 iterations that diverged with
// the preset's rates (docs/results.md).
constexpr float slower_fields = 0.25F;
// Relative to the rate of positions, during tracking: a shape that learns fast absorbs the lag of each key.
constexpr double share_while_tracking = 1.0 / 3;

// Keeps only edges between surfels that the field moves.
void leave_others(const Tensor<int32_t>& body, Tensor<int32_t>& edges) {
  for (int64_t i = 0; i < edges.dim(0); ++i) {
    for (int64_t k = 0; k < edges.dim(1); ++k) {
      int32_t& other = edges(i, k);
      if (other >= 0 && (body[i] != moved_by_field || body[other] != moved_by_field)) other = -1;
    }
  }
}

// The disk refused a checkpoint.
class NotSaved : public InputError {
 public:
  explicit NotSaved(const std::string& why) : InputError(why, "", "", "") {}
};

// The absolute path, or the given one if there is no working directory any more.
std::filesystem::path whole_path(const std::filesystem::path& given) {
  std::error_code error;
  std::filesystem::path whole = std::filesystem::absolute(given, error);
  return error ? given : whole;
}

// Makes paths absolute, so that the weights are found wherever the run is resumed.
TrainOptions with_whole_paths(TrainOptions options) {
  std::string& weights = options.loss.lpips_weights;
  if (!weights.empty()) weights = whole_path(weights).string();
  return options;
}

// Limits the initial sizes of the sets to their caps.
TrainOptions within(TrainOptions options, const SurfelCaps& caps) {
  const auto lowered = [](int& cap, int64_t to) { cap = static_cast<int>(std::clamp<int64_t>(to, 1, cap)); };
  lowered(options.density.max_surfels, caps.main);
  lowered(options.environment_density.max_surfels, caps.environment);
  return options;
}

// Removes implausible masks if bodies are tracked, since tracking relies on masks.
Capture with_likely_masks(Capture capture, const TrainOptions& options) {
  if (follows_bodies(capture, options)) leave_out_odd_masks(capture);
  return capture;
}

Random seeded(int64_t seed) { return Random(static_cast<uint64_t>(seed)); }

std::optional<lpips::Network> network_on(Device device, std::optional<lpips::Network> network) {
  return network ? std::optional(network->on(device)) : std::nullopt;
}

Scene scene_on(Device device, Scene scene) {
  scene.move_to(device);
  return scene;
}

}  // namespace

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

Trainer::Trainer(const TrainOptions& options, Capture capture, const std::filesystem::path& run,
                 Device device)
    : options_(with_whole_paths(options)),
      device_(device),
      capture_(with_likely_masks(std::move(capture), options)),
      views_checksum_(checksum_of_views(capture_)),
      cameras_(capture_.train),
      capture_folder_(whole_path(capture_.folder).lexically_normal().string()),
      run_{whole_path(run)},
      schedule_(options),
      perceptual_(network_on(device, perceptual_network(options.loss, capture_))),
      random_(seeded(options.seed)),
      memory_(plan_memory(memory_setting(options_, device, capture_))),
      targets_(device, memory_.image_bytes),
      scene_(scene_on(device, begin(initial_scene(capture_, within(options, memory_.caps), random_)))),
      optimiser_(scene_),
      main_density_("main", options.density, scene_.main.count(), device),
      environment_density_("environment", options.environment_density, scene_.environment.count(), device),
      cloud_radius_(points_in_view_ > 0 ? cloud_radius(capture_.points) : cloud_radius({})),
      environment_radius_(half_diagonal(scene_.environment.position.on(Device::cpu))),
      views_(static_cast<int64_t>(capture_.train.size())),
      divergence_(options.non_finite, options.collapse_decibels),
      renderer_(options.render, memory_.kept),
      meter_(device),
      before_step_{random_, views_, -1, {}, {}, {}, {}, {}, false} {
  density_changes_.reserve(2);
  if (device == Device::cuda) memory::set_device_budget(static_cast<size_t>(memory_.budget_bytes));
}

Scene Trainer::begin(InitialScene made) {
  points_ = made.points;
  points_in_view_ = made.points_in_view;
  initial_main_count_ = made.at_points;
  return std::move(made.scene);
}

FrameRequest Trainer::request_for(const View& view) {
  FrameRequest request;
  request.camera = view.camera;
  const double noise =
      schedule_.time_jitter(iteration_) * random_.normal() / static_cast<double>(capture_.train.size());
  request.time =
      scene_.main_motion ? view.time : std::clamp(view.time + static_cast<float>(noise), 0.0F, 1.0F);
  request.sh_degree_main = schedule_.sh_degree_main(iteration_);
  request.sh_degree_environment = schedule_.sh_degree_environment(iteration_);
  request.deform_main = schedule_.deforms_main(iteration_);
  request.deform_environment = schedule_.deforms_environment(iteration_);
  request.specular = schedule_.phase(iteration_) != Phase::diffuse;
  request.pseudo_normals = schedule_.uses_normal_losses(iteration_) && options_.loss.normal > 0;
  request.probes = true;
  request.probe_seed = random_.next();
  request.cull = true;
  return request;
}

NormalLosses Trainer::normal_losses(const Trainable& trainable, const Tracking& now) const {
  if (!trainable.main || !schedule_.uses_normal_losses(iteration_)) return NormalLosses::none;
  // A higher weight during tracking doubled the depth errors of mirrors.
  const bool mirrors = schedule_.phase(iteration_) != Phase::diffuse;
  return mirrors && !now.goes_on ? NormalLosses::more_on_mirrors : NormalLosses::even;
}

const View& Trainer::draw_view() {
  const Tracking now = tracking(iteration_);
  if (now.goes_on) return draw_tracked_view(now);
  const auto [first, last] =
      std::minmax_element(capture_.train.begin(), capture_.train.end(),
                          [](const View& a, const View& b) { return a.time < b.time; });
  // If there are bodies, they have been tracked through all times.
  const double latest =
      scene_.main_motion ? last->time : schedule_.latest_time(iteration_, first->time, last->time);
  for (;;) {
    const View& view = capture_.train[static_cast<size_t>(views_.draw(random_))];
    if (view.time <= latest || view.time == first->time) return view;
  }
}

void Trainer::fade(std::span<const int64_t> rows) {
  constexpr float transparent = -12;
  Tensor<float> opacity = scene_.main.opacity_logit.on(Device::cpu);
  for (const int64_t row : rows) opacity[row] = transparent;
  scene_.main.opacity_logit = opacity.on(device_);
}

LossValues Trainer::step() {
  density_changes_.clear();
  renderer_.options().samples = schedule_.samples(iteration_);
  const Surfels new_surface = follow_bodies(tracking(iteration_));
  const Tracking now = tracking(iteration_);
  const View& view = draw_view();
  ViewImages& target = targets_.of(capture_, view, scene_.main_motion.has_value());
  FrameRequest request = request_for(view);
  request.silhouette =
      scene_.main_motion && carries_ && options_.loss.silhouette > 0 && !target.coverage.empty();
  Trainable trainable = schedule_.trainable(iteration_);
  const bool has_followed = trainable.main && scene_.main_motion && !now.goes_on;
  trainable.main_motion = has_followed && !bodies_stand_ && !options_.deform.track.true_poses;
  trainable.main_nodes = has_followed && scene_.main_nodes;
  trainable.lighting = has_followed && scene_.lighting;
  // Gradients through reflections suppress the rotation of a body, so tracking does without reflections.
  if (now.goes_on) {
    request.specular = false;
    request.deform_main = false;
    trainable.main = true;
    trainable.main_field = false;
    trainable.tint = trainable.environment = trainable.environment_field = false;
    trainable.camera = false;
  }

  const Frame& frame = renderer_.forward(scene_, request, true);
  take_unknown(frame.colour, target);
  LossInputs inputs{frame, target, options_.loss, normal_losses(trainable, now)};
  if (schedule_.uses_lpips(iteration_)) inputs.perceptual = &*perceptual_;
  if (trainable.main_field && scene_.main_field && options_.loss.rigidity > 0 && frame.main.count() > 0) {
    inputs.rest = &scene_.main.position;
    inputs.neighbours = &neighbour_edges();
  }
  if (trainable.environment_field) inputs.environment_residuals = &renderer_.environment_residuals();
  evaluate_objective(inputs, {grad_frame_, grad_rest_}, means_);
  leave_unknown(target, grad_frame_.colour);
  if (review_) review_(frame, target, grad_frame_);
  LossValues terms = means_.read();
  const bool learns = std::isfinite(terms.total);
  if (learns) learn(view, frame, request, trainable);
  ++iteration_;
  non_finite_ = learns ? optimiser_.left_alone() : NonFiniteGradients{};
  control_density(iteration_, new_surface);
  return terms;
}

void Trainer::learn(const View& view, const Frame& frame, const FrameRequest& request,
                    const Trainable& trainable) {
  gradient_.reset(scene_);
  renderer_.backward(scene_, request, trainable, grad_frame_, gradient_);
  if (trainable.main_motion) share_among_keys();
  if (trainable.main_nodes) hold_nodes();
  if (trainable.lighting) {
    const LightingOptions& light = options_.deform.lighting;
    lighting::resist(*scene_.lighting, {light.size, light.haste, light.roughness}, gradient_.lighting);
  }
  const bool follows = tracking(iteration_).goes_on;
  // Only the initial surfels: newly added ones that are wrong may fade.
  if (follows) motion::hold_opacities(scene_.main.body, initial_main_count_, gradient_.main);
  parallel_for(device_, "train: add gradients at rest", grad_rest_.size(),
               AddNumbers{grad_rest_.data(), gradient_.main.position.data()});
  // Nothing has changed so far, so an iteration that runs out of memory before this line has no effect. The
  // code below allocates no memory, but the driver may when it starts a kernel.
  torn_ = true;
  const double share_of_positions = follows ? share_while_tracking : 1;
  optimiser_.step(scene_, gradient_, trainable, schedule_, options_.rates, iteration_, share_of_positions);
  if (trainable.camera) refine_camera(view);
  if (trainable.main) {
    main_density_.shorten_needles(scene_.main, cloud_radius_);
    main_density_.accumulate(gradient_.main_signal, gradient_.main_visible);
  }
  if (trainable.environment && scene_.environment.count() > 0) {
    environment_density_.shorten_needles(scene_.environment, environment_radius_);
    environment_density_.accumulate(gradient_.environment_signal, gradient_.environment_visible);
  }
  parallel_for(device_, "train: follow the displacement", 1,
               FollowMaxDisplacement{frame.max_displacement.data(), scene_.main_max_displacement.data()});
  torn_ = false;
}

void Trainer::refine_camera(const View& view) {
  cameras_.step(&view - capture_.train.data(), gradient_.camera, schedule_.camera_rate(iteration_),
                scene_.extent, options_.rates.adam());
  set_refined_cameras();
}

void Trainer::set_refined_cameras() {
  for (size_t i = 0; i < capture_.train.size(); ++i)
    capture_.train[i].camera = cameras_.camera(static_cast<int64_t>(i));
}

const Neighbours& Trainer::neighbour_edges() {
  if (neighbour_edges_.index.empty()) {
    Neighbours edges = spread_neighbours(scene_.main.position.on(Device::cpu), neighbours_each, bond_stride);
    if (scene_.main_motion) leave_others(scene_.main.body.on(Device::cpu), edges.index);
    neighbour_edges_ = edges.on(device_);
  }
  return neighbour_edges_;
}

void Trainer::control_density(int done, const Surfels& new_surface) {
  // If memory runs out in an update, the set is unchanged. The code after an update allocates none.
  const auto tell = [&](events::DensityChanged change, bool reset) {
    change.iteration = done;
    change.opacity_reset = reset;
    density_changes_.push_back(std::move(change));
  };
  if (new_surface.count() > 0) {
    tell(main_density_.add(scene_.main, optimiser_.main(), new_surface), false);
    neighbour_edges_ = {};
  }
  // Surfels that multiply where a body lags behind the photograph fix the lag in its shape.
  if (tracking(done - 1).goes_on) return;
  if (schedule_.densifies_main(done)) {
    const bool reset = schedule_.resets_main_opacity(done);
    const DensityLimits limits{{scene_.extent, cloud_radius_},
                               memory_.caps.main,
                               schedule_.prunes_large_main(done),
                               schedule_.prunes_faint_main(done)};
    tell(main_density_.update(scene_.main, optimiser_.main(), limits, random_), reset);
    neighbour_edges_ = {};
  }
  if (scene_.environment.count() > 0 && schedule_.densifies_environment(done)) {
    const bool reset = schedule_.resets_environment_opacity(done);
    const DensityLimits limits{{scene_.extent, environment_radius_},
                               memory_.caps.environment,
                               schedule_.prunes_large_environment(done),
                               schedule_.prunes_faint_environment(done)};
    tell(environment_density_.update(scene_.environment, optimiser_.environment(), limits, random_), reset);
  }
  if (schedule_.resets_main_opacity(done)) {
    main_density_.reset_opacity(scene_.main, optimiser_.main());
    divergence_.expect_fall();
  }
  if (scene_.environment.count() > 0 && schedule_.resets_environment_opacity(done)) {
    environment_density_.reset_opacity(scene_.environment, optimiser_.environment());
    divergence_.expect_fall();
  }
}

events::Step Trainer::step_event(const LossValues& terms, double step_seconds) {
  const double now = 1.0 / std::max(1e-9, step_seconds);
  rate_ = rate_ > 0 ? 0.95 * rate_ + 0.05 * now : now;
  events::Step event;
  event.iteration = iteration_;
  event.iterations = options_.iterations;
  event.phase = to_string(schedule_.phase(iteration_ - 1));
  event.loss = terms.total;
  for (const LossValue& term : terms.terms) event.terms.push_back({std::string(term.name), term.value});
  event.psnr = divergence_.smoothed_psnr();
  event.seconds = seconds_;
  event.rate = rate_;
  event.surfels = counts();
  event.memory_bytes = memory_in_use(device_);
  return event;
}

events::Finished Trainer::finish(events::Ending ending, const std::string& reason) {
  events::Finished event{ending, iteration_, seconds_, divergence_.smoothed_psnr(), counts(), reason};
  stream_.emit(event);
  return event;
}

void Trainer::emit_measured() {
  const Phase phase = schedule_.phase(std::max(0, iteration_ - 1));
  if (const auto measured = meter_.take(iteration_, to_string(phase))) stream_.emit(*measured);
}

void Trainer::emit_start() {
  stream_.emit(events::Started{capture_.name, run_.folder, iteration_, options_.iterations,
                               std::string(name_of(device_)), thread_count(),
                               static_cast<uint64_t>(options_.seed), counts(), memory_.forecast_bytes,
                               version(), this_machine(device_), points_, points_in_view_});
  for (const Finding& found : capture_.warnings) warn(found.text);
  if (iteration_ == 0 && points_ > 0 && points_in_view_ == 0) {
    warn("no training view sees any of the " + std::to_string(points_) +
         " points: surfels start at random; are the points in the capture's own coordinates?");
  }
  if (memory_.caps.lowered) {
    warn("the memory budget holds " + std::to_string(memory_.caps.main) + " main and " +
         std::to_string(memory_.caps.environment) + " environment surfels at most");
  }
}

void Trainer::emit_density() {
  for (const events::DensityChanged& change : density_changes_) stream_.emit(change);
  density_changes_.clear();
}

std::string Trainer::emit_iteration() {
  const Phase phase = schedule_.phase(iteration_);
  if (iteration_ == 0 || schedule_.phase(iteration_ - 1) != phase) {
    emit_measured();
    stream_.emit(events::PhaseEntered{iteration_, to_string(phase)});
  }
  before_step_ = Draws{random_, views_, iteration_, {}, {}, {}, {}, {}, bodies_stand_};
  if (const Tracking now = tracking(iteration_); now.enters || now.refines) {
    before_step_.motion = scene_.main_motion;
    before_step_.nodes = scene_.main_nodes;
    before_step_.lighting = scene_.lighting;
    before_step_.main = scene_.main;
    before_step_.texture_trust = texture_trust_;
  }
  const Clock::time_point start = Clock::now();
  LossValues terms;
  {
    const StepMeter::Iteration measured(meter_, iteration_);
    terms = step();
  }
  std::string trouble = divergence_.check(terms, non_finite_);
  const double step_seconds = seconds_since(start);
  seconds_ += step_seconds;
  emit_density();
  stream_.emit(step_event(terms, step_seconds));
  return trouble;
}

std::string Trainer::collapse_advice() const {
  if (divergence_.sound() || !schedule_.deforms_main(iteration_ - 1)) return "";
  const RateOptions& rates = options_.rates;
  return "; where it began with the motion, begin again with slower fields: --set rates.field=" +
         number_text(slower_fields * rates.field) +
         " --set rates.field_end=" + number_text(slower_fields * rates.field_end);
}

std::string Trainer::when_there_is_room() const {
  if (!torn_) return "; --resume goes on when there is room, or with a lower --memory-budget";
  const std::string lost = ", in the middle of a change that is not saved; ";
  return lost + (checkpoint_state_ == CheckpointState::none
                     ? "begin again when there is room, or with a lower --memory-budget"
                     : "--resume goes on from the checkpoint before when there is room, or with a lower "
                       "--memory-budget");
}

Trainer::End Trainer::iterate(const std::atomic<bool>& stop) {
  try {
    emit_start();
    while (iteration_ < options_.iterations && !stop && !stop_soon_) {
      const std::string trouble = emit_iteration();
      if (!trouble.empty()) return {events::Ending::diverged, trouble + collapse_advice()};
      if (iteration_ % options_.save_every == 0 && iteration_ < options_.iterations && divergence_.sound())
        save_on_the_way();
    }
  } catch (const memory::OutOfMemory& error) {
    return {events::Ending::out_of_memory, error.what() + when_there_is_room()};
  } catch (const std::bad_alloc&) {
    return {events::Ending::out_of_memory, "out of memory" + when_there_is_room()};
  } catch (const NotSaved&) {
    throw;
  } catch (const InputError& error) {
    return {events::Ending::no_input, std::string(error.what()) + "; when it is back, --resume goes on"};
  }
  if (iteration_ < options_.iterations) return {events::Ending::interrupted, "stopped on request"};
  return {events::Ending::completed, ""};
}

events::Finished Trainer::run(const std::atomic<bool>& stop) {
  const End end = iterate(stop);
  if (end.ending == events::Ending::out_of_memory || end.ending == events::Ending::no_input) rollback_draws();
  if (torn_) return finish(end.ending, end.reason);
  // A collapsed scene must not replace the last good checkpoint. A scene with a bad gradient is still good,
  // because the gradient was not applied.
  if (end.ending != events::Ending::diverged || divergence_.sound() ||
      checkpoint_state_ == CheckpointState::none)
    save_or_say_why_not();
  return finish(end.ending, end.reason);
}

void Trainer::save() {
  emit_measured();
  const Clock::time_point start = Clock::now();
  Safetensors file = checkpoint();
  file.metadata["train_seconds"] = std::to_string(seconds_);
  write_checkpoint(
      run_, std::move(file),
      checkpoint_state_ == CheckpointState::unsound ? Current::is_dropped : Current::becomes_previous);
  checkpoint_state_ = divergence_.sound() ? CheckpointState::sound : CheckpointState::unsound;
  const double took = seconds_since(start);
  seconds_ += took;
  stream_.emit(events::Saved{iteration_, run_.checkpoint(), took});
}

void Trainer::save_or_say_why_not() {
  const auto refused = [this](const std::exception& error) {
    return NotSaved("iteration " + std::to_string(iteration_) + " is not saved: " + error.what());
  };
  try {
    save();
  } catch (const InputError& error) {
    throw refused(error);
  } catch (const std::system_error& error) {
    throw refused(error);
  }
}

// Training continues if the disk refuses a checkpoint, because it may have room at the next one. It ends if
// the first one is refused, when little is lost.
void Trainer::save_on_the_way() {
  try {
    save_or_say_why_not();
  } catch (const NotSaved& error) {
    if (checkpoint_state_ == CheckpointState::none) throw;
    warn(std::string(error.what()) + "; training goes on and tries again at the next checkpoint");
  }
}

void Trainer::rollback_draws() {
  if (iteration_ == before_step_.iteration) {
    random_ = before_step_.random;
    views_ = before_step_.views;
    if (before_step_.motion) {
      // If the step added a body, the moments would not fit a checkpoint without it.
      if (scene_.main_motion->bodies() != before_step_.motion->bodies())
        optimiser_.begin(*before_step_.motion);
      scene_.main_motion = before_step_.motion;
      scene_.main_nodes = before_step_.nodes;
      scene_.lighting = before_step_.lighting;
      scene_.main = *before_step_.main;
      texture_trust_ = before_step_.texture_trust;
      bodies_stand_ = before_step_.bodies_stand;
    }
  }
  emit_density();
  // Frees the renderer's memory for the copies that saving makes.
  renderer_ = Renderer(options_.render, memory_.kept);
  gradient_ = {};
  grad_frame_ = {};
}

}  // namespace traceflow
