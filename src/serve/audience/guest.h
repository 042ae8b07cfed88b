#pragma once

#include <chrono>
#include <deque>
#include <limits>
#include <optional>
#include <variant>

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

// What a page asks for once.
using Question = std::variant<Probe, Still, Photo, Path>;

// Which frames may be made now, where time for them is short: those that a page has nothing of yet always
// may.
struct Allowed {
  bool refining = true;    // finer ones of what a page sees
  bool refreshing = true;  // of a scene that has changed since
};

// Which state the scene is in, and how long pages at rest wait to see a newer one.
struct SceneState {
  int64_t number = 0;
  std::chrono::steady_clock::duration refresh = {};
};

// One page: what it looks at, what it has been shown of it, and what it waits for.
class Guest {
 public:
  using Clock = std::chrono::steady_clock;

  Guest(uint64_t number, Send send) : number_(number), send_(std::move(send)) {}

  void send(const Outgoing& message) const { send_(message); }

  void look(const Look& look);
  void sleep() { asleep_ = true; }
  void seen(int64_t frame, Clock::time_point now);
  // False where too many wait already.
  bool ask(const Question& question);
  // A Look that cannot be shown is not tried again.
  void give_up(int64_t look);

  bool is_awake() const { return !asleep_; }
  bool asks() const { return !asked_.empty(); }
  // Takes the oldest question. Nothing where it is about what is looked at, and nothing is; then the page is
  // told.
  std::optional<Job> next_question();
  bool wants_frame(const Allowed& allowed, const SceneState& scene, Clock::time_point now) const;
  Job next_frame(Clock::time_point now);
  // When it got its last frame, or was to.
  Clock::time_point served() const { return served_; }

  // The number that a frame is given.
  int64_t next_number() const { return frames_ + 1; }
  // Sends a frame that was made of `pixels` in `seconds`.
  void show(const FrameJob& job, const Outgoing& message, double pixels, double seconds,
            const SceneState& scene);

  // There was no memory for a frame: coarser ones for a while.
  void no_memory_for(const FrameJob& job, Clock::time_point now);
  bool lacks_memory(Clock::time_point now) const { return now < coarse_until_; }

 private:
  struct Sent {
    int64_t frame;
    double bytes;
    Clock::time_point when;
  };

  bool sees_nothing() const { return shown_divisor_ == std::numeric_limits<double>::infinity(); }
  Coarseness coarseness(Clock::time_point now) const;

  uint64_t number_;
  Send send_;
  std::optional<Look> look_;
  bool asleep_ = true;
  std::deque<Question> asked_;
  Pacer pacer_;
  std::deque<Sent> on_their_way_;
  int64_t frames_ = 0;
  Clock::time_point served_ = {};
  // The finest frame of the present look that was made, and of which state of the scene.
  double shown_divisor_ = std::numeric_limits<double>::infinity();
  bool shown_final_ = false;
  int64_t shown_scene_ = -1;
  // Where memory ran out: no finer than this, until then; and nothing at all before.
  double least_divisor_ = 1;
  Clock::time_point coarse_until_ = {}, not_before_ = {};
};

}  // namespace traceflow::serve
