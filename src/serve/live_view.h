#pragma once

#include <atomic>
#include <functional>

#include "base/options.h"
#include "serve/audience/audience.h"
#include "serve/projector.h"
#include "serve/time_share.h"
#include "train/events.h"
#include "train/log_history.h"

namespace traceflow::serve {

struct ViewOptions {
  double share =
      0.25;  // of the training's time that pages may take while somebody looks, above 0 and under 1

  void validate() const;
};

// What a training run lets its viewer do. All but `stop` is called on the training's thread, between
// iterations.
struct TrainingHooks {
  std::function<Stage()> stage;
  std::function<void()> save;
  std::function<void(const events::Event&)> emit;
  std::function<void()> stop;                      // on any thread
  const std::atomic<bool>* interrupted = nullptr;  // the whole program is to end
};

// Shows a training run to the pages that look at it: a listener of its events, so that pictures are made
// between two iterations, on the training's thread and of a scene that stands still. They take a bounded
// share of the time. Training goes by the same bytes whether somebody looks or not.
class LiveView {
 public:
  LiveView(const ViewOptions& options, Setting setting, TrainingHooks hooks);

  // Whom the server talks to.
  Room& room() { return audience_; }

  // The log of a run that is resumed.
  void recall(const std::vector<LoggedEvent>& events) { audience_.tell(lines_of(thinned(events)), true); }
  void operator()(const events::Event& event);
  // After the training: whether a page is open.
  bool is_wanted();
  // Goes on until the last page has left, or the program is to end.
  void stay();

 private:
  using Clock = std::chrono::steady_clock;

  void on_step(const events::Step& step);
  void on_finished(const events::Finished& finished);
  void serve_while_paused();
  void save();
  // Serves one job, if there is one.
  bool serve(const Allowed& allowed);
  void flush_events();
  void command(Do what);

  TrainingHooks hooks_;
  Audience audience_;
  Projector projector_;
  std::atomic<bool> pause_{false}, save_{false}, stop_{false};
  State state_;
  std::vector<std::string> unsent_;
  std::string last_step_;
  Clock::time_point sent_ = {};
  TimeShare share_;
  Clock::time_point returned_;
};

}  // namespace traceflow::serve
