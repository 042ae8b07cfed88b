#pragma once

#include <atomic>
#include <functional>
#include <optional>

#include "record/log_tail.h"
#include "serve/clients/clients.h"
#include "serve/frame_server.h"
#include "serve/run_watch.h"
#include "viz/subject.h"

namespace traceflow::serve {

// Shows a scene that is not being trained by this program. A run that another process trains is followed: its
// newest checkpoint is shown and its log goes on.
class RunView {
 public:
  // What is shown and how far it was trained.
  struct Shown {
    viz::Subject subject;
    int64_t iteration = 0;
    int64_t iterations = 0;  // that the run is to have in all; 0 for what is no run
    std::string note = {};   // one line when it is not what was saved last; else empty
  };

  // Takes what is shown to the device. Throws what that throws, here alone.
  RunView(SceneInfo info, Shown shown, Device device);

  // For the server.
  MessageHandler& handler() { return clients_; }

  // Follows a run. When the run has saved a checkpoint, `reread` reads it to the host. Where that throws, the
  // pages get the error's text, the scene stays as it was, and the next check tries again.
  void follow(RunWatch watch, std::function<Shown()> reread,
              Clients::Clock::duration between_checks = std::chrono::seconds(1));

  // Until `stop` is set.
  void run(const std::atomic<bool>& stop);
  // One turn of that: serves one job, if one arrives within `most`, and checks the run when it is time.
  void turn(Clients::Clock::duration most);

 private:
  SceneView view() const;
  void take(Shown shown);
  // A scene for which the device has no memory is shown from the host.
  void move_to_device();
  void check_run();
  void send_log();

  Device device_;
  Shown shown_;
  Clients clients_;
  FrameServer frame_server_;
  std::function<Shown()> reread_;
  std::optional<RunWatch> watch_;
  std::optional<LogTail> log_;
  Clients::Clock::duration between_checks_ = {};
  Clients::Clock::time_point checked_ = {};
};

}  // namespace traceflow::serve
