#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "serve/audience/history.h"
#include "serve/audience/messages.h"
#include "serve/audience/pacer.h"
#include "serve/net/room.h"

namespace traceflow::serve {

// One thing that a page waits for.
struct FrameJob {
  Look look;
  Coarseness coarseness;
};
struct ProbeJob {
  Look look;
  Probe probe;
};
struct StillJob {
  Look look;
  Still still;
};
struct Job {
  uint64_t guest = 0;
  std::variant<FrameJob, ProbeJob, StillJob, Photo, Path> what;
};

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

  void enter(uint64_t guest, Send send) override;
  void hear(uint64_t guest, std::string_view text) override;
  void leave(uint64_t guest) override;

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
  std::optional<Job> next();

  // What came of a job. The header gets the frame's number. seconds: that it took; pixels: of the picture.
  void show_frame(const Job& job, nlohmann::ordered_json header, const std::string& picture, double pixels,
                  double seconds);
  void reply(uint64_t guest, Outgoing message);
  // A request that could not be answered.
  void refuse(uint64_t guest, const std::string& request, int64_t id, const std::string& why);
  void refuse(const Job& job, const std::string& why);
  int64_t viewers();
  // Pages that look now: not asleep.
  bool anybody_looks();

 private:
  struct Sent {
    int64_t frame;
    double bytes;
    Clock::time_point when;
  };
  struct Guest {
    Send send;
    std::optional<Look> look;
    bool asleep = true;
    std::deque<std::variant<Probe, Still, Photo, Path>> asked;
    Pacer pacer;
    std::deque<Sent> on_their_way;
    int64_t frames = 0;
    Clock::time_point served = {};  // when it got its last frame
    // The finest frame of the present look that was made, and of which state of the scene.
    double shown_divisor = std::numeric_limits<double>::infinity();
    bool shown_final = false;
    int64_t shown_scene = -1;
  };

  void refuse_look(uint64_t guest, int64_t id, const std::string& why);
  bool wants_frame(const Guest& guest, Clock::time_point now) const;
  std::optional<Job> ask_of(uint64_t number, Guest& guest);
  bool has_job(Clock::time_point now);
  void answer(Guest& guest, const Request& request);
  void send_to(Guest& guest, const std::string& text);
  void send_to_all(const std::string& text);
  std::string state_text() const;
  std::string trouble_text() const;

  std::function<void(Do)> on_command_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<uint64_t, Guest> guests_;
  std::string hello_;
  std::map<std::string, std::string> troubles_;
  State state_;
  History history_;
  int64_t scene_ = 0;
  Clock::duration refresh_ = {};
};

// A picture with its header: length of the header (32 bit, little endian), header, picture.
Outgoing picture_message(const nlohmann::ordered_json& header, const std::string& picture);
Outgoing text_message(std::string text);

}  // namespace traceflow::serve
