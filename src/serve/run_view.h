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

// Shows a scene that this program does not train. If another process trains the run, shows each new
// checkpoint and continues the log.
class RunView {
 public:
  // The shown scene and the state of its training.
  struct Shown {
    viz::Subject subject;
    int64_t iteration = 0;
    int64_t iterations = 0;  // planned iterations of the run; 0 if it is not a run
    std::string note = {};   // one line if this is not the newest checkpoint; else empty
  };

  // Moves the scene to the device. Throws the errors of that; later functions do not.
  RunView(SceneInfo info, Shown shown, Device device);

  // The handler for the server.
  MessageHandler& handler() { return clients_; }

  // Follows a run. When the run has saved a checkpoint, `reread` reads it to the host. If that throws, the
  // pages get the error's text, the scene stays the same, and the next check tries again.
  void follow(RunWatch watch, std::function<Shown()> reread,
              Clients::Clock::duration between_checks = std::chrono::seconds(1));

  // Serves until `stop` is set.
  void run(const std::atomic<bool>& stop);
  // One step of run(): serves one job, if one arrives within `most`, and checks the run if it is time.
  void turn(Clients::Clock::duration most);

 private:
  SceneView view() const;
  void take(Shown shown);
  // If the device has no memory for the scene, keeps it on the host.
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
