#include "serve/run_view.h"

#include "base/device_memory.h"

namespace traceflow::serve {

namespace {

using namespace std::chrono_literals;

constexpr auto between_checks = 200ms;
// Keys of warnings.
constexpr const char* about_run = "the run";
constexpr const char* about_device = "the device";

}  // namespace

RunView::RunView(SceneInfo info, Shown shown, Device device)
    : device_(device), frame_server_(clients_, std::move(info)) {
  shown.subject.scene.move_to(device_);
  take(std::move(shown));
}

SceneView RunView::view() const {
  return {shown_.subject.scene, shown_.subject.render, shown_.subject.request, shown_.iteration};
}

void RunView::take(Shown shown) {
  // Frees the old scene first: the device may not have memory for both.
  frame_server_.forget();
  shown_ = std::move(shown);
  move_to_device();
  frame_server_.send_hello(view());
  const Scene& scene = shown_.subject.scene;
  clients_.set_state(
      {false, true, shown_.iteration, shown_.iterations, scene.main.count(), scene.environment.count()});
  clients_.scene_changed({});
  clients_.set_warning(about_run, shown_.note);
}

void RunView::move_to_device() {
  Scene& scene = shown_.subject.scene;
  if (scene.device() == device_) return;
  try {
    scene.move_to(device_);
    frame_server_.forget();
    clients_.set_warning(about_device, "");
  } catch (const std::bad_alloc&) {
    scene.move_to(Device::cpu);  // the parts that had been moved
    clients_.set_warning(about_device,
                         "No memory for the scene on the device: pictures are made on the host, slowly.");
  }
}

void RunView::follow(RunWatch watch, std::function<Shown()> reread, Clients::Clock::duration between_checks) {
  reread_ = std::move(reread);
  log_.emplace(watch.run().log());
  watch_.emplace(std::move(watch));
  between_checks_ = between_checks;
  send_log();
}

void RunView::send_log() {
  const LogTail::News news = log_->next();
  clients_.add_log_lines(lines_of(news.anew ? thinned(news.events) : news.events), news.anew);
}

void RunView::check_run() {
  if (!watch_ || Clients::Clock::now() - checked_ < between_checks_) return;
  const RunWatch::Change change = watch_->poll();
  std::string warning;
  try {
    if (change.saved) {
      take(reread_());
      watch_->accept();
    } else {
      move_to_device();
    }
    send_log();
    warning = shown_.note;
  } catch (const memory::OutOfMemory& error) {
    warning = std::string("No memory for what the run has saved. ") + error.what();
  } catch (const std::bad_alloc&) {
    warning = "No memory on this machine for what the run has saved.";
  } catch (const std::exception& error) {
    warning = std::string("What the run has saved cannot be read. ") + error.what();
  }
  if (change.vanished) {
    warning = "The run is gone from " + watch_->run().folder.string() + ". What is shown was read before.";
  }
  clients_.set_warning(about_run, warning);
  checked_ = Clients::Clock::now();
}

void RunView::turn(Clients::Clock::duration most) {
  if (clients_.wait(most)) {
    if (const std::optional<Job> job = clients_.next()) frame_server_.answer(*job, view());
  }
  check_run();
}

void RunView::run(const std::atomic<bool>& stop) {
  while (!stop) turn(between_checks);
}

}  // namespace traceflow::serve
