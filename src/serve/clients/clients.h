#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "serve/clients/client.h"
#include "serve/clients/history.h"
#include "serve/clients/replies.h"

namespace traceflow::serve {

// The state of the training. Every page gets it when it changes.
struct State {
  bool paused = false;
  bool over = false;  // the training has ended
  int64_t iteration = 0;
  int64_t iterations = 0;  // 0 without training
  int64_t main_surfels = 0;
  int64_t environment_surfels = 0;
  bool operator==(const State&) const = default;
};

// The connected pages and their pending requests. The network thread delivers their messages; the rendering
// thread takes jobs. There are no jobs if no page is awake.
class Clients : public MessageHandler {
 public:
  using Clock = std::chrono::steady_clock;

  // on_command: pause, resume, save, stop; called on the network thread. Without it, commands are refused.
  explicit Clients(std::function<void(Action)> on_command = {}) : on_command_(std::move(on_command)) {}

  void on_connect(uint64_t number, Send send) override;
  void on_message(uint64_t number, std::string_view text) override;
  void on_disconnect(uint64_t number) override;

  // The first message to every page (messages.ts, Hello). Connected pages get it again.
  void set_hello(std::string hello);
  void set_state(const State& state);
  // Sends lines of a training log (record/event_log.h) to the pages. reset: they replace the earlier lines.
  void add_log_lines(const std::vector<std::string>& events, bool reset = false);
  // Shows a warning on every page until it is set to an empty text. about: its key, since several can exist.
  void set_warning(const std::string& about, const std::string& text);
  // Call after the scene has changed. A page with a resting camera gets a new frame once `refresh` has passed
  // since its last.
  void scene_changed(Clock::duration refresh);

  // Waits until there is a job, at most for `timeout`. Returns whether there is one.
  bool wait(Clock::duration timeout);
  // The next job, in turn from each page. One-time requests come before frames.
  std::optional<Job> next(const Allowed& allowed);
  std::optional<Job> next() { return next({}); }

  // Sends the frame of a job. Adds the frame's number to the header. seconds: for rendering and encoding;
  // pixels: of the picture.
  void show_frame(const Job& job, nlohmann::ordered_json header, const std::string& picture, double pixels,
                  double seconds);
  void reply(uint64_t number, const Outgoing& message);
  // Reports that the job failed.
  void refuse(const Job& job, const std::string& why);
  // Reports that memory ran out for a frame: the page gets coarser frames for a while.
  void no_memory_for(const Job& job);
  bool any_lacks_memory();
  bool is_connected(uint64_t number);
  int64_t viewers();
  // Whether any page is awake.
  bool any_awake();

 private:
  Client* find(uint64_t number);
  void broadcast(const Outgoing& message);
  void answer(Client& client, const Request& request);
  Outgoing state_message() const;
  Outgoing warning_message() const;
  bool has_job(Clock::time_point now);

  std::function<void(Action)> on_command_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<uint64_t, Client> clients_;
  std::string hello_;
  std::map<std::string, std::string> warnings_;
  State state_;
  History history_;
  SceneState scene_;
};

}  // namespace traceflow::serve
