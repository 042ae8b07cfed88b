#include "serve/audience/audience.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/overloaded.h"

namespace traceflow::serve {

namespace {

// What is known of a message that could not be read: its type and number, for the page to make sense of the
// refusal.
std::pair<std::string, int64_t> label_of(std::string_view text) {
  std::pair<std::string, int64_t> label = {"", 0};
  const nlohmann::json json = nlohmann::json::parse(text.begin(), text.end(), nullptr, false);
  if (!json.is_object()) return label;
  if (json.contains("type") && json["type"].is_string())
    label.first = json["type"].get<std::string>().substr(0, 16);
  if (json.contains("id") && json["id"].is_number_integer()) label.second = json["id"].get<int64_t>();
  return label;
}

// The type and number of the request that a job answers.
std::pair<const char*, int64_t> label_of(const Job& job) {
  using Label = std::pair<const char*, int64_t>;
  return std::visit(Overloaded{[](const FrameJob& frame) { return Label("look", frame.look.id); },
                               [](const ProbeJob& probe) { return Label("probe", probe.probe.id); },
                               [](const StillJob& still) { return Label("still", still.still.id); },
                               [](const Photo&) { return Label("photo", 0); },
                               [](const Path& path) { return Label("path", path.id); }},
                    job.what);
}

}  // namespace

Guest* Audience::find(uint64_t number) {
  const auto found = guests_.find(number);
  return found == guests_.end() ? nullptr : &found->second;
}

void Audience::send_to_all(const Outgoing& message) {
  for (const auto& [number, guest] : guests_) guest.send(message);
}

Outgoing Audience::state_message() const {
  return json_message(
      {{"type", "state"},
       {"paused", state_.paused},
       {"over", state_.over},
       {"iteration", state_.iteration},
       {"iterations", state_.iterations},
       {"surfels", {{"main", state_.main_surfels}, {"environment", state_.environment_surfels}}},
       {"viewers", guests_.size()}});
}

Outgoing Audience::trouble_message() const {
  std::string all;
  for (const auto& [about, text] : troubles_) all += (all.empty() ? "" : " ") + text;
  return json_message({{"type", "trouble"}, {"text", all}});
}

void Audience::enter(uint64_t number, Send send) {
  const std::lock_guard lock(mutex_);
  const Guest& guest = guests_.try_emplace(number, number, std::move(send)).first->second;
  if (!hello_.empty()) guest.send(text_message(hello_));
  guest.send(text_message(events_text(history_.lines(), true)));
  if (!troubles_.empty()) guest.send(trouble_message());
  send_to_all(state_message());
}

void Audience::leave(uint64_t number) {
  const std::lock_guard lock(mutex_);
  guests_.erase(number);
  send_to_all(state_message());
}

void Audience::hear(uint64_t number, std::string_view text) {
  Request request;
  try {
    request = parse_request(text);
  } catch (const InputError& error) {
    const auto [type, id] = label_of(text);
    reply(number, refusal(type, id, error.what()));
    return;
  }
  if (const auto* command = std::get_if<Command>(&request)) {
    if (on_command_) {
      on_command_(command->what);
    } else {
      reply(number, refusal("command", 0, "nothing is being trained here"));
    }
  } else {
    const std::lock_guard lock(mutex_);
    if (Guest* guest = find(number)) answer(*guest, request);
  }
  changed_.notify_all();
}

void Audience::answer(Guest& guest, const Request& request) {
  std::visit(
      Overloaded{[&](const Look& look) { guest.look(look); }, [&](const Sleep&) { guest.sleep(); },
                 [&](const Seen& seen) { guest.seen(seen.frame, Clock::now()); }, [](const Command&) {},
                 [&](const auto& question) {
                   if (!guest.ask(question)) guest.send(refusal("", 0, "too many questions"));
                 }},
      request);
}

void Audience::greet_with(std::string hello) {
  const std::lock_guard lock(mutex_);
  if (hello == hello_) return;
  hello_ = std::move(hello);
  send_to_all(text_message(hello_));
}

void Audience::set_state(const State& state) {
  const std::lock_guard lock(mutex_);
  if (state == state_) return;
  state_ = state;
  send_to_all(state_message());
}

void Audience::tell(const std::vector<std::string>& events, bool reset) {
  const std::lock_guard lock(mutex_);
  if (reset) history_.clear();
  for (const std::string& line : events) history_.add(line);
  if (reset) {
    send_to_all(text_message(events_text(history_.lines(), true)));
  } else if (!events.empty()) {
    send_to_all(text_message(events_text(events, false)));
  }
}

void Audience::tell_trouble(const std::string& about, const std::string& text) {
  const std::lock_guard lock(mutex_);
  const auto known = troubles_.find(about);
  if (text == (known == troubles_.end() ? "" : known->second)) return;
  if (text.empty()) {
    troubles_.erase(known);
  } else {
    troubles_[about] = text;
  }
  send_to_all(trouble_message());
}

void Audience::scene_changed(Clock::duration refresh) {
  const std::lock_guard lock(mutex_);
  ++scene_.number;
  scene_.refresh = refresh;
}

bool Audience::has_job(Clock::time_point now) {
  return std::any_of(guests_.begin(), guests_.end(), [&](const auto& entry) {
    return entry.second.asks() || entry.second.wants_frame({}, scene_, now);
  });
}

bool Audience::wait(Clock::duration timeout) {
  std::unique_lock lock(mutex_);
  if (has_job(Clock::now())) return true;
  changed_.wait_for(lock, timeout);
  return has_job(Clock::now());
}

std::optional<Job> Audience::next(const Allowed& allowed) {
  const std::lock_guard lock(mutex_);
  for (auto& [number, guest] : guests_) {
    while (guest.asks()) {
      if (auto job = guest.next_question()) return job;
    }
  }
  const Clock::time_point now = Clock::now();
  Guest* longest_waiting = nullptr;
  for (auto& [number, guest] : guests_) {
    if (!guest.wants_frame(allowed, scene_, now)) continue;
    if (longest_waiting == nullptr || guest.served() < longest_waiting->served()) longest_waiting = &guest;
  }
  if (longest_waiting == nullptr) return std::nullopt;
  return longest_waiting->next_frame(now);
}

void Audience::show_frame(const Job& job, nlohmann::ordered_json header, const std::string& picture,
                          double pixels, double seconds) {
  const std::lock_guard lock(mutex_);
  Guest* guest = find(job.guest);
  if (guest == nullptr) return;
  header["frame"] = guest->next_number();
  guest->show(std::get<FrameJob>(job.what), picture_message(header, picture), pixels, seconds, scene_);
}

void Audience::reply(uint64_t number, const Outgoing& message) {
  const std::lock_guard lock(mutex_);
  if (const Guest* guest = find(number)) guest->send(message);
}

void Audience::refuse(const Job& job, const std::string& why) {
  const auto [type, id] = label_of(job);
  const std::lock_guard lock(mutex_);
  Guest* guest = find(job.guest);
  if (guest == nullptr) return;
  if (std::holds_alternative<FrameJob>(job.what)) guest->give_up(id);
  guest->send(refusal(type, id, why));
}

void Audience::no_memory_for(const Job& job) {
  const std::lock_guard lock(mutex_);
  if (Guest* guest = find(job.guest)) guest->no_memory_for(std::get<FrameJob>(job.what), Clock::now());
}

bool Audience::anybody_lacks_memory() {
  const std::lock_guard lock(mutex_);
  const Clock::time_point now = Clock::now();
  return std::any_of(guests_.begin(), guests_.end(),
                     [&](const auto& entry) { return entry.second.lacks_memory(now); });
}

bool Audience::is_here(uint64_t number) {
  const std::lock_guard lock(mutex_);
  return guests_.contains(number);
}

int64_t Audience::viewers() {
  const std::lock_guard lock(mutex_);
  return static_cast<int64_t>(guests_.size());
}

bool Audience::anybody_looks() {
  const std::lock_guard lock(mutex_);
  return std::any_of(guests_.begin(), guests_.end(),
                     [](const auto& entry) { return entry.second.is_awake(); });
}

}  // namespace traceflow::serve
