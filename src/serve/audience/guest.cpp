#include "serve/audience/guest.h"

#include "base/overloaded.h"
#include "serve/audience/replies.h"

namespace traceflow::serve {

namespace {

constexpr size_t most_asked = 32;        // questions that wait for an answer
constexpr size_t most_on_their_way = 2;  // frames that the page has not shown yet
// After memory ran out: how long frames stay coarse, and how long nothing is tried.
constexpr std::chrono::seconds coarse_for{30}, breath{1};

}  // namespace

void Guest::look(const Look& look) {
  look_ = look;
  asleep_ = false;
  shown_divisor_ = std::numeric_limits<double>::infinity();
  shown_final_ = false;
}

void Guest::seen(int64_t frame, Clock::time_point now) {
  while (!on_their_way_.empty() && on_their_way_.front().frame <= frame) {
    const Sent& sent = on_their_way_.front();
    pacer_.carried(sent.bytes, std::chrono::duration<double>(now - sent.when).count());
    on_their_way_.pop_front();
  }
}

bool Guest::ask(const Question& question) {
  if (asked_.size() >= most_asked) return false;
  asked_.push_back(question);
  return true;
}

void Guest::give_up(int64_t look) {
  if (look_ && look_->id == look) look_.reset();
}

std::optional<Job> Guest::next_question() {
  const Question question = std::move(asked_.front());
  asked_.pop_front();
  const auto about_look = [&](const char* name, int64_t id, auto make) -> std::optional<Job> {
    if (look_) return Job{number_, make(*look_)};
    send_(refusal(name, id, "nothing has been looked at yet"));
    return std::nullopt;
  };
  return std::visit(
      Overloaded{[&](const Photo& photo) {
                   return std::optional<Job>({number_, photo});
                 },
                 [&](const Path& path) {
                   return std::optional<Job>({number_, path});
                 },
                 [&](const Probe& probe) {
                   return about_look("probe", probe.id, [&](const Look& l) { return ProbeJob{l, probe}; });
                 },
                 [&](const Still& still) {
                   return about_look("still", still.id, [&](const Look& l) { return StillJob{l, still}; });
                 }},
      question);
}

bool Guest::wants_frame(const Allowed& allowed, const SceneState& scene, Clock::time_point now) const {
  if (!look_ || asleep_ || on_their_way_.size() >= most_on_their_way) return false;
  if (now < not_before_) return false;
  if (sees_nothing()) return true;
  if (look_->moving) return false;
  if (!shown_final_) return allowed.refining;
  return allowed.refreshing && shown_scene_ != scene.number && now - served_ >= scene.refresh;
}

Coarseness Guest::coarseness(Clock::time_point now) const {
  const double pixels = static_cast<double>(look_->width) * look_->height;
  Coarseness chosen = Pacer::whole();
  if (sees_nothing()) {
    chosen = pacer_.moving(pixels);
  } else if (!shown_final_) {
    chosen = pacer_.finer(pixels, shown_divisor_);
  }
  if (!lacks_memory(now) || chosen.divisor >= least_divisor_) return chosen;
  // As fine as it can be.
  return {least_divisor_, chosen.quality, !look_->moving};
}

Job Guest::next_frame(Clock::time_point now) {
  served_ = now;
  return {number_, FrameJob{*look_, coarseness(now)}};
}

void Guest::show(const FrameJob& job, const Outgoing& message, double pixels, double seconds,
                 const SceneState& scene) {
  const auto bytes = static_cast<double>(message.bytes->size());
  pacer_.made(pixels, seconds, bytes, job.coarseness.quality);
  served_ = Clock::now();
  on_their_way_.push_back({++frames_, bytes, served_});
  send_(message);
  // A newer Look may have come while this one was rendered.
  if (!look_ || look_->id != job.look.id) return;
  shown_divisor_ = job.coarseness.divisor;
  shown_final_ = job.coarseness.final;
  shown_scene_ = scene.number;
}

void Guest::no_memory_for(const FrameJob& job, Clock::time_point now) {
  least_divisor_ = 2 * job.coarseness.divisor;
  coarse_until_ = now + coarse_for;
  not_before_ = now + breath;
}

}  // namespace traceflow::serve
