#pragma once

#include <atomic>
#include <functional>

#include "serve/audience/audience.h"
#include "serve/projector.h"
#include "serve/run_watch.h"
#include "show/subject.h"

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
  };

  RunView(Setting setting, Shown shown);

  // Whom the server talks to.
  Room& room() { return audience_; }

  // Follows a run: `reread` reads it anew when it has been saved, and throws InputError when that cannot be.
  void follow(const RunFolder& run, std::function<Shown()> reread);

  // Until `stop` is set.
  void run(const std::atomic<bool>& stop);

 private:
  Stage stage() const;
  void take(Shown shown);
  // Looks at the run's folder, now and then.
  void look_after_run();

  Setting setting_;
  Shown shown_;
  Audience audience_;
  Projector projector_;
  RunFolder folder_;
  std::function<Shown()> reread_;
  std::optional<RunWatch> watch_;
  Audience::Clock::time_point looked_ = {};
  std::string trouble_;
};

}  // namespace traceflow::serve
