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

#include "serve/audience/guest.h"
#include "serve/audience/history.h"
#include "serve/audience/replies.h"

namespace traceflow::serve {

// What is told to every page when it changes.
struct State {
  bool paused = false;
  bool over = false;  // the training has ended
  int64_t iteration = 0;
  int64_t iterations = 0;  // 0 where nothing is trained
  int64_t main_surfels = 0;
  int64_t environment_surfels = 0;
  bool operator==(const State&) const = default;
};

// The pages that are connected and what each wants next. Pages talk to it on the network's thread; whoever
// renders asks it for jobs from another. While nobody looks there is no job.
class Audience : public Room {
 public:
  using Clock = std::chrono::steady_clock;

  // on_command: pause, resume, save, stop; called on the network's thread. Without it they are refused.
  explicit Audience(std::function<void(Do)> on_command = {}) : on_command_(std::move(on_command)) {}

  void enter(uint64_t number, Send send) override;
  void hear(uint64_t number, std::string_view text) override;
  void leave(uint64_t number) override;

  // What every page hears first (messages.ts, Hello); those that are here hear it again.
  void greet_with(std::string hello);
  void set_state(const State& state);
  // Adds lines of a training log (train/event_log.h) to what pages know. reset: they replace what was known.
  void tell(const std::vector<std::string>& events, bool reset = false);
  // Something is wrong, in words; empty: it is over. about: which trouble it is; there may be several.
  void tell_trouble(const std::string& about, const std::string& text);
  // The scene is another one from now on, or at another state; pages at rest see it at the next refresh,
  // which comes when `refresh` has gone by since their last frame.
  void scene_changed(Clock::duration refresh);

  // Waits until there is a job, at most so long.
  bool wait(Clock::duration timeout);
  // The next job, in turns among the pages; what was asked for once comes before frames.
  std::optional<Job> next(const Allowed& allowed);
  std::optional<Job> next() { return next({}); }

  // What came of a job. The header gets the frame's number. seconds: that it took; pixels: of the picture.
  void show_frame(const Job& job, nlohmann::ordered_json header, const std::string& picture, double pixels,
                  double seconds);
  void reply(uint64_t number, const Outgoing& message);
  // It could not be done.
  void refuse(const Job& job, const std::string& why);
  // There was no memory for a frame: the page gets coarser ones for a while.
  void no_memory_for(const Job& job);
  bool anybody_lacks_memory();
  bool is_here(uint64_t number);
  int64_t viewers();
  // Pages that look now: not asleep.
  bool anybody_looks();

 private:
  Guest* find(uint64_t number);
  void send_to_all(const Outgoing& message);
  void answer(Guest& guest, const Request& request);
  Outgoing state_message() const;
  Outgoing trouble_message() const;
  bool has_job(Clock::time_point now);

  std::function<void(Do)> on_command_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<uint64_t, Guest> guests_;
  std::string hello_;
  std::map<std::string, std::string> troubles_;
  State state_;
  History history_;
  SceneState scene_;
};

}  // namespace traceflow::serve
