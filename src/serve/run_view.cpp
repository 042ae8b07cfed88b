#include "serve/run_view.h"

#include "base/error.h"
#include "train/log_history.h"

namespace traceflow::serve {

namespace {

using namespace std::chrono_literals;

constexpr auto nap = 200ms;
constexpr auto between_looks = 1s;

}  // namespace

RunView::RunView(Setting setting, Shown shown)
    : setting_(setting), projector_(audience_, std::move(setting)) {
  take(std::move(shown));
}

Stage RunView::stage() const {
  return {shown_.subject.scene, shown_.subject.render, shown_.subject.request, shown_.iteration};
}

void RunView::take(Shown shown) {
  projector_.forget();
  shown_ = std::move(shown);
  projector_.greet(stage());
  const Scene& scene = shown_.subject.scene;
  audience_.set_state(
      {false, true, shown_.iteration, shown_.iterations, scene.main.count(), scene.environment.count()});
  audience_.scene_changed({});
}

void RunView::follow(const RunFolder& run, std::function<Shown()> reread) {
  folder_ = run;
  reread_ = std::move(reread);
  watch_.emplace(run);
  audience_.tell(lines_of(thinned(read_log(run.log()))), true);
}

void RunView::look_after_run() {
  if (!watch_ || Audience::Clock::now() - looked_ < between_looks) return;
  looked_ = Audience::Clock::now();
  const RunWatch::Change change = watch_->look();
  if (change.returned) trouble_.clear();
  if (change.vanished) {
    trouble_ = "The run is gone from " + folder_.folder.string() + ". What is shown was read before.";
  } else if (change.saved) {
    try {
      take(reread_());
      trouble_.clear();
    } catch (const InputError& error) {
      trouble_ = std::string("The run cannot be read any more. ") + error.what();
    }
  }
  if (change.logged) audience_.tell(lines_of(thinned(read_log(folder_.log()))), true);
  audience_.tell_trouble("the run", trouble_);
}

void RunView::run(const std::atomic<bool>& stop) {
  while (!stop) {
    if (audience_.wait(nap)) {
      if (const std::optional<Job> job = audience_.next()) projector_.answer(*job, stage());
    }
    look_after_run();
  }
}

}  // namespace traceflow::serve
