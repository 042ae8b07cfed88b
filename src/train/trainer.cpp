#include "train/trainer.h"

#include <cmath>
#include <system_error>

#include "base/clock.h"
#include "base/options.h"
#include "base/parallel.h"
#include "base/version.h"
#include "files/options_json.h"
#include "render/frame_kernels.h"
#include "scene/scene_file.h"
#include "train/checkpoint.h"
#include "train/continuation.h"
#include "train/initialise.h"
#include "train/odd_masks.h"

namespace traceflow {

namespace {

// Every fourth of a surfel's 32 nearest neighbours: enough to keep a shape, and far enough to suppress
// wrinkles.
constexpr int neighbour_stride = 4;
// Relative to the rates, suggested after a collapse. It saved a video of 8,000 iterations that diverged with
// the preset's rates (docs/results.md).
constexpr float slower_fields = 0.25F;
// Relative to the rate of positions, during tracking: a shape that learns fast absorbs the lag of each key.
constexpr double share_while_tracking = 1.0 / 3;
// Iterations between two shortenings of surfels that extend into unseen space.
constexpr int unseen_every = 20;

// Keeps only edges between surfels that the field moves.
void keep_edges_of_field(const Tensor<int32_t>& body, Tensor<int32_t>& edges) {
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
std::filesystem::path absolute_path(const std::filesystem::path& given) {
  std::error_code error;
  std::filesystem::path absolute = std::filesystem::absolute(given, error);
  return error ? given : absolute;
}

// Makes paths absolute, so that the weights are found wherever the run is resumed.
TrainOptions with_absolute_paths(TrainOptions options) {
  std::string& weights = options.loss.lpips_weights;
  if (!weights.empty()) weights = absolute_path(weights).string();
  return options;
}

// Removes implausible masks if bodies are tracked, since tracking relies on masks.
Capture with_likely_masks(Capture capture, const TrainOptions& options) {
  if (follows_bodies(capture, options)) leave_out_odd_masks(capture);
  return capture;
}

}  // namespace

Trainer::Trainer(const TrainOptions& options, Capture capture, const std::filesystem::path& run,
                 Device device)
    : options_(with_absolute_paths(options)),
      device_(device),
      capture_(with_likely_masks(std::move(capture), options)),
      views_checksum_(checksum_of_views(capture_)),
      capture_folder_(absolute_path(capture_.folder).lexically_normal().string()),
      run_{absolute_path(run)},
      schedule_(options),
      perceptual_(perceptual_network(options.loss, capture_)),
      memory_(plan_memory(memory_setting(options_, device, capture_))),
      targets_(device, memory_.image_bytes),
      state_(initial_state()),
      cloud_radius_(points_in_view_ > 0 ? cloud_radius(capture_.points) : cloud_radius({})),
      renderer_(options.render, memory_.kept),
      bodies_(options_, schedule_, capture_, state_, renderer_, stream_),
      meter_(device) {
  density_changes_.reserve(2);
  if (perceptual_) perceptual_ = perceptual_->on(device);
  if (device == Device::cuda) memory::set_device_budget(static_cast<size_t>(memory_.budget_bytes));
}

TrainingState Trainer::initial_state() {
  Random random(static_cast<uint64_t>(options_.seed));
  InitialScene made = initial_scene(capture_, limited_to(memory_.caps, options_), random);
  points_ = made.points;
  points_in_view_ = made.points_in_view;
  made.scene.move_to(device_);
  TrainingState state(options_, capture_, std::move(made.scene));
  state.random = random;
  state.initial_main_count = made.at_points;
  state.environment_radius = half_diagonal(state.scene.environment.position.on(Device::cpu));
  return state;
}

void Trainer::resume() {
  std::string note;
  const Safetensors file = read_checkpoint(run_, note);
  Scene scene = get_scene(file);
  check_views(file, scene.normalisation, capture_);
  check_found_masks(file, capture_, run_.masks());
  scene.move_to(device_);
  state_ = get_state(file, std::move(scene), options_, capture_, cloud_radius_);
  state_.apply_to(capture_.train);
  checkpoint_state_ = state_.divergence.sound() ? CheckpointState::sound : CheckpointState::unsound;
  // Whatever memory is free now: with other caps the run would end with other bytes.
  if (const std::optional<SurfelCaps> caps = caps_to_keep(file, options_)) {
    memory_ = with_caps(memory_, memory_setting(options_, device_, capture_), *caps);
    warn(resumed_plan_warning(memory_, available_bytes(device_)));
  }
  warn(other_arithmetic(file, device_));
  warn(other_version(file));
  if (note.empty()) return;
  // Last, so that the files remain unchanged if resuming fails.
  warn(note);
  set_damaged_aside(run_);
}

void Trainer::fade(std::span<const int64_t> rows) {
  constexpr float transparent = -12;
  Tensor<float> opacity = state_.scene.main.opacity_logit.on(Device::cpu);
  for (const int64_t row : rows) opacity[row] = transparent;
  state_.scene.main.opacity_logit = opacity.on(device_);
}

const View& Trainer::draw_view(bool tracks) {
  if (tracks) return bodies_.draw_view();
  const auto [first, last] =
      std::minmax_element(capture_.train.begin(), capture_.train.end(),
                          [](const View& a, const View& b) { return a.time < b.time; });
  // If there are bodies, they have been tracked through all times.
  const double latest = state_.scene.main_motion
                            ? last->time
                            : schedule_.latest_time(state_.iteration, first->time, last->time);
  for (;;) {
    const View& view = capture_.train[static_cast<size_t>(state_.views.draw(state_.random))];
    if (view.time <= latest || view.time == first->time) return view;
  }
}

FrameRequest Trainer::request_for(const View& view, const ViewImages& target) {
  const int iteration = state_.iteration;
  const bool has_motion = state_.scene.main_motion.has_value();
  FrameRequest request;
  request.camera = view.camera;
  const double noise =
      schedule_.time_jitter(iteration) * state_.random.normal() / static_cast<double>(capture_.train.size());
  request.time = has_motion ? view.time : std::clamp(view.time + static_cast<float>(noise), 0.0F, 1.0F);
  request.sh_degree_main = schedule_.sh_degree_main(iteration);
  request.sh_degree_environment = schedule_.sh_degree_environment(iteration);
  request.deform_main = schedule_.deforms_main(iteration);
  request.deform_environment = schedule_.deforms_environment(iteration);
  request.specular = schedule_.phase(iteration) != Phase::diffuse;
  request.pseudo_normals = schedule_.uses_normal_losses(iteration) && options_.loss.normal > 0;
  request.silhouette =
      has_motion && !state_.bodies.released && options_.loss.silhouette > 0 && !target.coverage.empty();
  request.probes = true;
  request.probe_seed = state_.random.next();
  request.cull = true;
  return request;
}

NormalLosses Trainer::normal_losses(const Trainable& trainable, bool tracks) const {
  if (!trainable.main || !schedule_.uses_normal_losses(state_.iteration)) return NormalLosses::none;
  // A higher weight during tracking doubled the depth errors of mirrors.
  const bool mirrors = schedule_.phase(state_.iteration) != Phase::diffuse;
  return mirrors && !tracks ? NormalLosses::more_on_mirrors : NormalLosses::even;
}

const Neighbours& Trainer::neighbours() {
  if (state_.neighbours.index.empty()) {
    const Surfels& main = state_.scene.main;
    Neighbours edges =
        spread_neighbours(main.position.on(Device::cpu), neighbours_per_surfel, neighbour_stride);
    if (state_.scene.main_motion) keep_edges_of_field(main.body.on(Device::cpu), edges.index);
    state_.neighbours = edges.on(device_);
  }
  return state_.neighbours;
}

LossValues Trainer::step() {
  density_changes_.clear();
  const int iteration = state_.iteration;
  renderer_.options().samples = schedule_.samples(iteration);
  state_.begin_iteration(bodies_.step().solves_poses());
  const Surfels new_surface = bodies_.update(memory_.caps.main);
  const bool tracks = bodies_.step().tracks;
  const View& view = draw_view(tracks);
  ViewImages& target = targets_.of(capture_, view, state_.scene.main_motion.has_value());
  FrameRequest request = request_for(view, target);
  Trainable trainable = schedule_.trainable(iteration);
  bodies_.configure(request, trainable);

  const Frame& frame = renderer_.forward(state_.scene, request, true);
  take_unknown(frame.colour, target);
  LossInputs inputs{frame, target, options_.loss, normal_losses(trainable, tracks)};
  if (trainable.main) inputs.depth_prior_share = schedule_.depth_prior_share(iteration);
  if (schedule_.uses_lpips(iteration)) inputs.perceptual = &*perceptual_;
  if (trainable.main_field && state_.scene.main_field && options_.loss.rigidity > 0 &&
      frame.main.count() > 0) {
    inputs.rest = &state_.scene.main.position;
    inputs.neighbours = &neighbours();
  }
  if (trainable.environment_field) inputs.environment_residuals = &renderer_.environment_residuals();
  evaluate_objective(inputs, {grad_frame_, grad_rest_}, means_);
  leave_unknown(target, grad_frame_.colour);
  if (review_) review_(frame, target, grad_frame_);
  LossValues terms = means_.read();
  const bool learns = std::isfinite(terms.total);
  if (learns) learn(view, frame, request, trainable);
  state_.end_iteration();
  non_finite_ = learns ? state_.optimiser.non_finite() : NonFiniteGradients{};
  control_density(new_surface, tracks);
  return terms;
}

void Trainer::learn(const View& view, const Frame& frame, const FrameRequest& request,
                    const Trainable& trainable) {
  Scene& scene = state_.scene;
  gradient_.reset(scene);
  renderer_.backward(scene, request, trainable, grad_frame_, gradient_);
  bodies_.constrain(trainable, gradient_);
  parallel_for(device_, "train: add gradients at rest", grad_rest_.size(),
               AddNumbers{grad_rest_.data(), gradient_.main.position.data()});
  state_.optimiser.prepare(scene, gradient_, trainable, schedule_, options_.rates, state_.iteration,
                           bodies_.step().tracks ? share_while_tracking : 1);
  if (trainable.camera) {
    state_.cameras.step(&view - capture_.train.data(), gradient_.camera,
                        schedule_.camera_rate(state_.iteration), scene.extent, options_.rates.adam());
  }
  // An iteration that runs out of memory before this line has no effect. The code below allocates no memory,
  // but the driver may when it starts a kernel.
  half_updated_ = true;
  state_.optimiser.step();
  if (trainable.camera) state_.apply_to(capture_.train);
  if (trainable.main) {
    state_.main_density.shorten_needles(scene.main, cloud_radius_);
    state_.main_density.accumulate(gradient_.main_signal, gradient_.main_visible);
  }
  if (trainable.environment && scene.environment.count() > 0) {
    state_.environment_density.shorten_needles(scene.environment, state_.environment_radius);
    state_.environment_density.accumulate(gradient_.environment_signal, gradient_.environment_visible);
  }
  parallel_for(device_, "train: follow the displacement", 1,
               FollowMaxDisplacement{frame.max_displacement.data(), scene.main_max_displacement.data()});
  half_updated_ = false;
}

Tensor<Camera<float>> Trainer::training_cameras() const {
  Tensor<Camera<float>> cameras({static_cast<int64_t>(capture_.train.size())});
  for (size_t k = 0; k < capture_.train.size(); ++k)
    cameras[static_cast<int64_t>(k)] = capture_.train[k].camera;
  return cameras.on(device_);
}

void Trainer::control_density(const Surfels& new_surface, bool tracks) {
  // If memory runs out in an update, the set is unchanged. The code after an update allocates none.
  const int done = state_.iteration;
  const auto tell = [&](events::DensityChanged change, bool reset) {
    change.iteration = done;
    change.opacity_reset = reset;
    density_changes_.push_back(std::move(change));
  };
  const auto control = [&](DensityControl& density, Surfels& surfels, SurfelMoments& moments,
                           const DensityStep& now, float radius, int64_t cap) {
    if (now.densifies) {
      const DensityLimits limits{{state_.scene.extent, radius}, cap, now.prunes_large, now.prunes_faint};
      tell(density.update(surfels, moments, limits, state_.random), now.resets_opacity);
    }
    if (now.resets_opacity) {
      density.reset_opacity(surfels, moments);
      state_.divergence.expect_fall();
    }
    return now.densifies;
  };
  Scene& scene = state_.scene;
  if (new_surface.count() > 0) {
    tell(state_.main_density.add(scene.main, state_.optimiser.main(), new_surface), false);
    state_.neighbours = {};
  }
  // Surfels that multiply where a body lags behind the photograph fix the lag in its shape.
  if (tracks) return;
  const Tensor<Camera<float>> cameras = done % unseen_every == 0 && options_.density.longest_unseen > 0
                                            ? training_cameras()
                                            : Tensor<Camera<float>>();
  if (control(state_.main_density, scene.main, state_.optimiser.main(), schedule_.main_density(done),
              cloud_radius_, memory_.caps.main))
    state_.neighbours = {};
  if (!cameras.empty()) state_.main_density.shorten_unseen(scene.main, cameras, cloud_radius_);
  if (scene.environment.count() == 0) return;
  control(state_.environment_density, scene.environment, state_.optimiser.environment(),
          schedule_.environment_density(done), state_.environment_radius, memory_.caps.environment);
}

events::Finished Trainer::run(const std::atomic<bool>& stop) {
  const End end = iterate(stop);
  if (end.ending == events::Ending::out_of_memory || end.ending == events::Ending::no_input) roll_back();
  // A collapsed scene must not replace the last good checkpoint. A scene with a bad gradient is still good,
  // because the gradient was not applied.
  const bool is_worth_saving = end.ending != events::Ending::diverged || state_.divergence.sound() ||
                               checkpoint_state_ == CheckpointState::none;
  if (!half_updated_ && is_worth_saving) save_or_throw();
  return finish(end);
}

Trainer::End Trainer::iterate(const std::atomic<bool>& stop) {
  const auto out_of_memory = [&](const std::string& what) {
    return End{events::Ending::out_of_memory,
               what + out_of_memory_advice(half_updated_, checkpoint_state_ != CheckpointState::none)};
  };
  try {
    emit_start();
    while (state_.iteration < options_.iterations && !stop && !stop_soon_) {
      const std::string problem = emit_iteration();
      if (!problem.empty()) return {events::Ending::diverged, problem + collapse_advice()};
      if (state_.iteration % options_.save_every == 0 && state_.iteration < options_.iterations &&
          state_.divergence.sound())
        save_or_warn();
    }
  } catch (const memory::OutOfMemory& error) {
    return out_of_memory(error.what());
  } catch (const std::bad_alloc&) {
    return out_of_memory("out of memory");
  } catch (const NotSaved&) {
    throw;
  } catch (const InputError& error) {
    return {events::Ending::no_input, std::string(error.what()) + "; when it is back, --resume goes on"};
  }
  if (state_.iteration < options_.iterations) return {events::Ending::interrupted, "stopped on request"};
  return {events::Ending::completed, ""};
}

std::string Trainer::emit_iteration() {
  const int iteration = state_.iteration;
  const Phase phase = schedule_.phase(iteration);
  if (iteration == 0 || schedule_.phase(iteration - 1) != phase) {
    emit_measured();
    stream_.emit(events::PhaseEntered{iteration, to_string(phase)});
  }
  const Clock::time_point start = Clock::now();
  LossValues terms;
  {
    const StepMeter::Iteration measured(meter_, iteration);
    terms = step();
  }
  std::string problem = state_.divergence.check(terms, non_finite_);
  const double step_seconds = seconds_since(start);
  state_.seconds += step_seconds;
  emit_density();
  emit_step(terms, step_seconds);
  return problem;
}

void Trainer::roll_back() {
  state_.roll_back();
  state_.apply_to(capture_.train);
  emit_density();
  // Frees the renderer's memory for the copies that saving makes.
  renderer_ = Renderer(options_.render, memory_.kept);
  gradient_ = {};
  grad_frame_ = {};
}

std::string Trainer::collapse_advice() const {
  if (state_.divergence.sound() || !schedule_.deforms_main(state_.iteration - 1)) return "";
  const RateOptions& rates = options_.rates;
  return "; where it began with the motion, begin again with slower fields: --set rates.field=" +
         number_text(slower_fields * rates.field) +
         " --set rates.field_end=" + number_text(slower_fields * rates.field_end);
}

void Trainer::save() {
  emit_measured();
  const Clock::time_point start = Clock::now();
  Safetensors file;
  put_state(state_, file);
  file.metadata["options"] = options_to_json(options_);
  file.metadata["capture"] = capture_.name;
  file.metadata["capture_folder"] = capture_folder_;
  put_views(views_checksum_, file);
  put_found_masks(capture_, file);
  put_caps(memory_.caps, file);
  put_arithmetic(device_, file);
  put_version(file);
  write_checkpoint(
      run_, std::move(file),
      checkpoint_state_ == CheckpointState::unsound ? Current::is_dropped : Current::becomes_previous);
  checkpoint_state_ = state_.divergence.sound() ? CheckpointState::sound : CheckpointState::unsound;
  const double took = seconds_since(start);
  state_.seconds += took;
  stream_.emit(events::Saved{state_.iteration, run_.checkpoint(), took});
}

void Trainer::save_or_throw() {
  try {
    save();
  } catch (const std::runtime_error& error) {  // an InputError, or the system's
    throw NotSaved("iteration " + std::to_string(state_.iteration) + " is not saved: " + error.what());
  }
}

// Training continues if the disk refuses a checkpoint, because it may have room at the next one. It ends if
// the first one is refused, when little is lost.
void Trainer::save_or_warn() {
  try {
    save_or_throw();
  } catch (const NotSaved& error) {
    if (checkpoint_state_ == CheckpointState::none) throw;
    warn(std::string(error.what()) + "; training goes on and tries again at the next checkpoint");
  }
}

void Trainer::warn(const std::string& text) {
  if (!text.empty()) stream_.emit(events::Warning{state_.iteration, text});
}

void Trainer::emit_start() {
  stream_.emit(events::Started{capture_.name, run_.folder, state_.iteration, options_.iterations,
                               std::string(name_of(device_)), thread_count(),
                               static_cast<uint64_t>(options_.seed), counts(), memory_.forecast_bytes,
                               version(), this_machine(device_), points_, points_in_view_});
  for (const Finding& found : capture_.warnings) warn(found.text);
  if (state_.iteration == 0 && points_ > 0 && points_in_view_ == 0) {
    warn("no training view sees any of the " + std::to_string(points_) +
         " points: surfels start at random; are the points in the capture's own coordinates?");
  }
  warn(lowered_caps_warning(memory_.caps));
}

void Trainer::emit_measured() {
  const Phase phase = schedule_.phase(std::max(0, state_.iteration - 1));
  if (const auto measured = meter_.take(state_.iteration, to_string(phase))) stream_.emit(*measured);
}

void Trainer::emit_density() {
  for (const events::DensityChanged& change : density_changes_) stream_.emit(change);
  density_changes_.clear();
}

void Trainer::emit_step(const LossValues& terms, double step_seconds) {
  const double now = 1.0 / std::max(1e-9, step_seconds);
  rate_ = rate_ > 0 ? 0.95 * rate_ + 0.05 * now : now;
  events::Step event;
  event.iteration = state_.iteration;
  event.iterations = options_.iterations;
  event.phase = to_string(schedule_.phase(state_.iteration - 1));
  event.loss = terms.total;
  for (const LossValue& term : terms.terms) event.terms.push_back({std::string(term.name), term.value});
  event.psnr = state_.divergence.smoothed_psnr();
  event.seconds = state_.seconds;
  event.rate = rate_;
  event.surfels = counts();
  event.memory_bytes = memory_in_use(device_);
  stream_.emit(event);
}

events::Finished Trainer::finish(const End& end) {
  events::Finished event{end.ending, state_.iteration, state_.seconds, state_.divergence.smoothed_psnr(),
                         counts(),   end.reason};
  stream_.emit(event);
  return event;
}

}  // namespace traceflow
