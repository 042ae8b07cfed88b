#include "serve/clients/client.h"

#include "base/overloaded.h"
#include "serve/clients/replies.h"

namespace traceflow::serve {

namespace {

constexpr size_t max_questions = 32;  // waiting for an answer
constexpr size_t max_in_flight = 2;   // frames sent but not yet displayed
// After memory ran out: how long frames stay coarse, and how long none is rendered.
constexpr std::chrono::seconds coarse_for{30}, retry_after{1};

}  // namespace

void Client::request_view(const ViewRequest& view_request) {
  view_request_ = view_request;
  asleep_ = false;
  shown_divisor_ = std::numeric_limits<double>::infinity();
  shown_final_ = false;
}

void Client::frame_shown(int64_t frame, Clock::time_point now) {
  while (!in_flight_.empty() && in_flight_.front().frame <= frame) {
    const Sent& sent = in_flight_.front();
    pacer_.displayed(sent.bytes, std::chrono::duration<double>(now - sent.when).count());
    in_flight_.pop_front();
  }
}

bool Client::ask(const Question& question) {
  if (questions_.size() >= max_questions) return false;
  questions_.push_back(question);
  return true;
}

void Client::drop_view(int64_t id) {
  if (view_request_ && view_request_->id == id) view_request_.reset();
}

std::optional<Job> Client::next_question() {
  const Question question = std::move(questions_.front());
  questions_.pop_front();
  const auto about_view = [&](const char* name, int64_t id, auto make) -> std::optional<Job> {
    if (view_request_) return Job{number_, make(*view_request_)};
    send_(refusal(name, id, "no view has been requested"));
    return std::nullopt;
  };
  return std::visit(Overloaded{[&](const Photo& photo) {
                                 return std::optional<Job>({number_, photo});
                               },
                               [&](const Path& path) {
                                 return std::optional<Job>({number_, path});
                               },
                               [&](const Probe& probe) {
                                 return about_view("probe", probe.id, [&](const ViewRequest& view) {
                                   return ProbeJob{view, probe};
                                 });
                               },
                               [&](const Still& still) {
                                 return about_view("still", still.id, [&](const ViewRequest& view) {
                                   return StillJob{view, still};
                                 });
                               }},
                    question);
}

bool Client::wants_frame(const Allowed& allowed, const SceneState& scene, Clock::time_point now) const {
  if (!view_request_ || asleep_ || in_flight_.size() >= max_in_flight) return false;
  if (now < not_before_) return false;
  if (sees_nothing()) return true;
  if (view_request_->moving) return false;
  if (!shown_final_) return allowed.refining;
  return allowed.refreshing && shown_scene_ != scene.number && now - served_ >= scene.refresh;
}

Coarseness Client::coarseness(Clock::time_point now) const {
  const double pixels = static_cast<double>(view_request_->width) * view_request_->height;
  Coarseness chosen = Pacer::full();
  if (sees_nothing()) {
    chosen = pacer_.moving(pixels);
  } else if (!shown_final_) {
    chosen = pacer_.finer(pixels, shown_divisor_);
  }
  if (!lacks_memory(now) || chosen.divisor >= min_divisor_) return chosen;
  // The finest allowed.
  return {min_divisor_, chosen.quality, !view_request_->moving};
}

Job Client::next_frame(Clock::time_point now) {
  served_ = now;
  return {number_, FrameJob{*view_request_, coarseness(now)}};
}

void Client::show(const FrameJob& job, const Outgoing& message, double pixels, double seconds,
                  const SceneState& scene) {
  const auto bytes = static_cast<double>(message.bytes->size());
  pacer_.rendered(pixels, seconds, bytes, job.coarseness.quality);
  served_ = Clock::now();
  in_flight_.push_back({++frames_, bytes, served_});
  send_(message);
  // A newer ViewRequest may have arrived meanwhile.
  if (!view_request_ || view_request_->id != job.view_request.id) return;
  shown_divisor_ = job.coarseness.divisor;
  shown_final_ = job.coarseness.final;
  shown_scene_ = scene.number;
}

void Client::no_memory_for(const FrameJob& job, Clock::time_point now) {
  min_divisor_ = 2 * job.coarseness.divisor;
  coarse_until_ = now + coarse_for;
  not_before_ = now + retry_after;
}

}  // namespace traceflow::serve
