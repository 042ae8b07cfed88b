#include "serve/run_view.h"

#include "base/device_memory.h"

namespace traceflow::serve {

namespace {

using namespace std::chrono_literals;

constexpr auto between_looks = 200ms;
// What troubles are about.
constexpr const char* about_run = "the run";
constexpr const char* about_device = "the device";

}  // namespace

RunView::RunView(Setting setting, Shown shown, Device device)
    : device_(device), projector_(audience_, std::move(setting)) {
  shown.subject.scene.move_to(device_);
  take(std::move(shown));
}

Stage RunView::stage() const {
  return {shown_.subject.scene, shown_.subject.render, shown_.subject.request, shown_.iteration};
}

void RunView::take(Shown shown) {
  // The old scene goes before the new one comes: a device may not hold both.
  projector_.forget();
  shown_ = std::move(shown);
  move_to_device();
  projector_.greet(stage());
  const Scene& scene = shown_.subject.scene;
  audience_.set_state(
      {false, true, shown_.iteration, shown_.iterations, scene.main.count(), scene.environment.count()});
  audience_.scene_changed({});
  audience_.tell_trouble(about_run, shown_.note);
}

void RunView::move_to_device() {
  Scene& scene = shown_.subject.scene;
  if (scene.device() == device_) return;
  try {
    scene.move_to(device_);
    projector_.forget();
    audience_.tell_trouble(about_device, "");
  } catch (const std::bad_alloc&) {
    scene.move_to(Device::cpu);  // those parts that found room
    audience_.tell_trouble(about_device,
                           "No memory for the scene on the device: pictures are made on the host, slowly.");
  }
}

void RunView::follow(RunWatch watch, std::function<Shown()> reread, Audience::Clock::duration between_looks) {
  reread_ = std::move(reread);
  log_.emplace(watch.run().log());
  watch_.emplace(std::move(watch));
  between_looks_ = between_looks;
  tell_log();
}

void RunView::tell_log() {
  const LogTail::News news = log_->next();
  audience_.tell(lines_of(news.anew ? thinned(news.events) : news.events), news.anew);
}

void RunView::look_after_run() {
  if (!watch_ || Audience::Clock::now() - looked_ < between_looks_) return;
  const RunWatch::Change change = watch_->look();
  std::string trouble;
  try {
    if (change.saved) {
      take(reread_());
      watch_->accept();
    } else {
      move_to_device();
    }
    tell_log();
    trouble = shown_.note;
  } catch (const memory::OutOfMemory& error) {
    trouble = std::string("No memory for what the run has saved. ") + error.what();
  } catch (const std::bad_alloc&) {
    trouble = "No memory on this machine for what the run has saved.";
  } catch (const std::exception& error) {
    trouble = std::string("What the run has saved cannot be read. ") + error.what();
  }
  if (change.vanished) {
    trouble = "The run is gone from " + watch_->run().folder.string() + ". What is shown was read before.";
  }
  audience_.tell_trouble(about_run, trouble);
  looked_ = Audience::Clock::now();
}

void RunView::turn(Audience::Clock::duration most) {
  if (audience_.wait(most)) {
    if (const std::optional<Job> job = audience_.next()) projector_.answer(*job, stage());
  }
  look_after_run();
}

void RunView::run(const std::atomic<bool>& stop) {
  while (!stop) turn(between_looks);
}

}  // namespace traceflow::serve
