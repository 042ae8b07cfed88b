#pragma once

#include <atomic>
#include <functional>

#include "base/options.h"
#include "record/events.h"
#include "record/log_history.h"
#include "serve/clients/clients.h"
#include "serve/frame_server.h"
#include "serve/time_share.h"

namespace traceflow::serve {

struct ViewOptions {
  double share = 0.25;  // fraction of the time for rendering while a page is open, above 0 and below 1

  void validate() const;
};

// Functions by which the viewer controls a training. All except `stop` are called on the training's thread,
// between iterations.
struct TrainingHooks {
  std::function<SceneView()> view;
  std::function<void()> save;
  std::function<void(const events::Event&)> emit;
  std::function<void()> stop;                      // on any thread
  const std::atomic<bool>* interrupted = nullptr;  // set when the program should end
};

// Shows a training to the open pages. It listens to the training's events and renders between two iterations,
// on the training's thread, for a limited share of the time. The trained scene is the same to the byte with
// and without open pages.
class LiveView {
 public:
  LiveView(const ViewOptions& options, SceneInfo info, TrainingHooks hooks);

  // The handler for the server.
  MessageHandler& handler() { return clients_; }

  // Takes the log of a resumed run.
  void restore_log(const std::vector<LoggedEvent>& events) {
    clients_.add_log_lines(lines_of(thinned(events)), true);
  }
  void operator()(const events::Event& event);
  // Whether a page is open after the training.
  bool is_wanted();
  // Serves until the last page has closed or the program should end.
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
  void command(Action action);

  TrainingHooks hooks_;
  Clients clients_;
  FrameServer frame_server_;
  std::atomic<bool> pause_{false}, save_{false}, stop_{false};
  State state_;
  std::vector<std::string> unsent_;
  std::string last_step_;
  Clock::time_point sent_ = {};
  TimeShare share_;
  Clock::time_point returned_;
};

}  // namespace traceflow::serve
