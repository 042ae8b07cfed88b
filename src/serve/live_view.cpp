#include "serve/live_view.h"

#include "record/event_log.h"

namespace traceflow::serve {

namespace {

using namespace std::chrono_literals;

constexpr auto between_events = 200ms;
constexpr auto refresh = 500ms;
constexpr auto longest_wait = 100ms;

double seconds(std::chrono::steady_clock::duration d) { return std::chrono::duration<double>(d).count(); }

}  // namespace

void ViewOptions::validate() const {
  check_option(share > 0 && share < 1, "view-share", share, "above 0 and under 1");
}

LiveView::LiveView(const ViewOptions& options, SceneInfo info, TrainingHooks hooks)
    : hooks_(std::move(hooks)),
      clients_([this](Action action) { command(action); }),
      frame_server_(clients_, std::move(info)),
      share_(options.share),
      returned_(Clock::now()) {}

void LiveView::command(Action action) {
  switch (action) {
    case Action::pause:
      pause_ = true;
      break;
    case Action::resume:
      pause_ = false;
      break;
    case Action::save:
      save_ = true;
      break;
    case Action::stop:
      stop_ = true;
      hooks_.stop();
      break;
  }
}

void LiveView::operator()(const events::Event& event) {
  if (const auto* step = std::get_if<events::Step>(&event)) {
    on_step(*step);
    return;
  }
  // Keeps the order of events: the unsent step comes first.
  if (!last_step_.empty()) unsent_.push_back(std::exchange(last_step_, {}));
  unsent_.push_back(to_json_line(event));
  if (const auto* started = std::get_if<events::Started>(&event)) {
    state_ = {false,
              false,
              started->iteration,
              started->iterations,
              started->surfels.main,
              started->surfels.environment};
    frame_server_.send_hello(hooks_.view());
    clients_.set_state(state_);
    returned_ = Clock::now();
  }
  flush_events();
  if (const auto* finished = std::get_if<events::Finished>(&event)) on_finished(*finished);
}

void LiveView::on_step(const events::Step& step) {
  Clock::time_point now = Clock::now();
  share_.trained(seconds(now - returned_));
  const auto charge = [&] {
    const Clock::time_point before = std::exchange(now, Clock::now());
    share_.spent(seconds(now - before));
  };
  last_step_ = to_json_line(step);
  state_.iteration = step.iteration;
  state_.main_surfels = step.surfels.main;
  state_.environment_surfels = step.surfels.environment;
  if (now - sent_ >= between_events) flush_events();

  clients_.scene_changed(refresh);
  while (share_.is_open() && serve(share_.allowed())) charge();
  frame_server_.scene_changed(hooks_.view().scene.device());
  charge();
  if (save_.exchange(false)) save();
  if (pause_) serve_while_paused();
  returned_ = Clock::now();
}

void LiveView::serve_while_paused() {
  state_.paused = true;
  hooks_.emit(events::Paused{state_.iteration, true});
  while (pause_ && !stop_ && !*hooks_.interrupted) {
    if (save_.exchange(false)) save();
    if (clients_.wait(longest_wait)) serve({});
  }
  pause_ = false;
  state_.paused = false;
  hooks_.emit(events::Paused{state_.iteration, false});
  frame_server_.scene_changed(hooks_.view().scene.device());
}

// A failed save, requested by a page, must not end the training.
void LiveView::save() {
  try {
    hooks_.save();
    clients_.set_warning("saving", "");
  } catch (const std::exception& error) {
    clients_.set_warning("saving", std::string("Not saved. ") + error.what());
  }
}

bool LiveView::serve(const Allowed& allowed) {
  const std::optional<Job> job = clients_.next(allowed);
  if (job) frame_server_.answer(*job, hooks_.view());
  return job.has_value();
}

void LiveView::flush_events() {
  if (!last_step_.empty()) unsent_.push_back(std::exchange(last_step_, {}));
  clients_.add_log_lines(unsent_);
  unsent_.clear();
  clients_.set_state(state_);
  sent_ = Clock::now();
}

void LiveView::on_finished(const events::Finished& finished) {
  state_.iteration = finished.iteration;
  state_.over = true;
  clients_.set_state(state_);
  clients_.scene_changed({});
}

bool LiveView::is_wanted() { return clients_.viewers() > 0 && !*hooks_.interrupted; }

void LiveView::stay() {
  while (is_wanted()) {
    if (clients_.wait(longest_wait)) serve({});
  }
}

}  // namespace traceflow::serve
