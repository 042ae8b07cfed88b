#pragma once

#include <atomic>
#include <functional>
#include <optional>

#include "serve/audience/audience.h"
#include "serve/projector.h"
#include "serve/run_watch.h"
#include "show/subject.h"
#include "train/log_tail.h"

namespace traceflow::serve {

// Shows a scene that is not being trained by this program. A run that another process trains is followed: its
// newest checkpoint is shown and its log goes on.
class RunView {
 public:
  // What is shown and how far it was trained.
  struct Shown {
    show::Subject subject;
    int64_t iteration = 0;
    int64_t iterations = 0;  // that the run is to have in all; 0 for what is no run
    std::string note = {};   // one line when it is not what was saved last; else empty
  };

  // Takes what is shown to the device. Throws what that throws, here alone.
  RunView(Setting setting, Shown shown, Device device);

  // Whom the server talks to.
  Room& room() { return audience_; }

  // Follows a run. `reread` reads it anew, to the host, when it has been saved; whatever it throws is told to
  // the pages, what was read before stays, and it is called again at the next look.
  void follow(RunWatch watch, std::function<Shown()> reread,
              Audience::Clock::duration between_looks = std::chrono::seconds(1));

  // Until `stop` is set.
  void run(const std::atomic<bool>& stop);
  // One turn of that: answers one page, when one asks within `most`, and looks after the run when it is time.
  void turn(Audience::Clock::duration most);

 private:
  Stage stage() const;
  void take(Shown shown);
  // A scene for which the device has no memory is shown from the host.
  void move_to_device();
  void look_after_run();
  void tell_log();

  Device device_;
  Shown shown_;
  Audience audience_;
  Projector projector_;
  std::function<Shown()> reread_;
  std::optional<RunWatch> watch_;
  std::optional<LogTail> log_;
  Audience::Clock::duration between_looks_ = {};
  Audience::Clock::time_point looked_ = {};
};

}  // namespace traceflow::serve
