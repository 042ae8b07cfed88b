#pragma once

#include <chrono>
#include <deque>
#include <limits>
#include <optional>
#include <variant>

#include "serve/clients/messages.h"
#include "serve/clients/pacer.h"
#include "serve/net/message_handler.h"

namespace traceflow::serve {

// A picture or an answer that a page waits for.
struct FrameJob {
  ViewRequest view_request;
  Coarseness coarseness;
};
struct ProbeJob {
  ViewRequest view_request;
  Probe probe;
};
struct StillJob {
  ViewRequest view_request;
  Still still;
};
struct Job {
  uint64_t client = 0;
  std::variant<FrameJob, ProbeJob, StillJob, Photo, Path> what;
};

// A one-time request.
using Question = std::variant<Probe, Still, Photo, Path>;

// The frames that may be rendered now if time is short. The first frame of a ViewRequest is always allowed.
struct Allowed {
  bool refining = true;    // finer frames of the shown picture
  bool refreshing = true;  // frames of a scene that has changed
};

// The version of the scene, and how long a resting page waits for a newer one.
struct SceneState {
  int64_t number = 0;
  std::chrono::steady_clock::duration refresh = {};
};

// One page: its camera, the frames sent to it, and its pending requests.
class Client {
 public:
  using Clock = std::chrono::steady_clock;

  Client(uint64_t number, Send send) : number_(number), send_(std::move(send)) {}

  void send(const Outgoing& message) const { send_(message); }

  void request_view(const ViewRequest& view_request);
  void sleep() { asleep_ = true; }
  void frame_shown(int64_t frame, Clock::time_point now);
  // Returns false if too many are waiting.
  bool ask(const Question& question);
  // A ViewRequest that cannot be rendered is not tried again.
  void drop_view(int64_t id);

  bool is_awake() const { return !asleep_; }
  bool has_question() const { return !questions_.empty(); }
  // Takes the oldest question. If it needs a ViewRequest and there is none, refuses it and returns nothing.
  std::optional<Job> next_question();
  bool wants_frame(const Allowed& allowed, const SceneState& scene, Clock::time_point now) const;
  Job next_frame(Clock::time_point now);
  // The time when its last frame was sent or started.
  Clock::time_point served() const { return served_; }

  // The number of the next frame.
  int64_t next_number() const { return frames_ + 1; }
  // Sends a frame of `pixels` that was rendered in `seconds`.
  void show(const FrameJob& job, const Outgoing& message, double pixels, double seconds,
            const SceneState& scene);

  // Memory ran out for a frame: coarser frames for a while.
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
  std::optional<ViewRequest> view_request_;
  bool asleep_ = true;
  std::deque<Question> questions_;
  Pacer pacer_;
  std::deque<Sent> in_flight_;
  int64_t frames_ = 0;
  Clock::time_point served_ = {};
  // The finest frame sent of the present ViewRequest, and the version of its scene.
  double shown_divisor_ = std::numeric_limits<double>::infinity();
  bool shown_final_ = false;
  int64_t shown_scene_ = -1;
  // After memory ran out: no frame finer than this until coarse_until_, and none before not_before_.
  double min_divisor_ = 1;
  Clock::time_point coarse_until_ = {}, not_before_ = {};
};

}  // namespace traceflow::serve
