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
  double share = 0.25;  // of the time that may go into pictures while a page is open, above 0 and under 1

  void validate() const;
};

// What the viewer may do with a training. All but `stop` are called on the training's thread, between
// iterations.
struct TrainingHooks {
  std::function<SceneView()> view;
  std::function<void()> save;
  std::function<void(const events::Event&)> emit;
  std::function<void()> stop;                      // on any thread
  const std::atomic<bool>* interrupted = nullptr;  // set when the program shall end
};

// Shows a training to the open pages. It listens to the training's events, so it renders between two
// iterations, on the training's thread, and takes a bounded share of the time. The trained scene is the same
// to the byte whether a page is open or not.
class LiveView {
 public:
  LiveView(const ViewOptions& options, SceneInfo info, TrainingHooks hooks);

  // For the server.
  MessageHandler& handler() { return clients_; }

  // The log of a run that is resumed.
  void restore_log(const std::vector<LoggedEvent>& events) {
    clients_.add_log_lines(lines_of(thinned(events)), true);
  }
  void operator()(const events::Event& event);
  // After the training: whether a page is open.
  bool is_wanted();
  // Serves until the last page has closed or the program shall end.
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
