#include "serve/audience/audience.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/overloaded.h"

#include "base/error.h"

namespace traceflow::serve {

namespace {

using Json = nlohmann::ordered_json;

constexpr size_t most_asked = 32;        // questions of one page that wait for an answer
constexpr size_t most_on_their_way = 2;  // frames that a page has not shown yet

std::string dump(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

// What is known of a message that could not be read: its type and number, for the page to make sense of the
// refusal.
std::pair<std::string, int64_t> label_of(std::string_view text) {
  const nlohmann::json json = nlohmann::json::parse(text.begin(), text.end(), nullptr, false);
  std::pair<std::string, int64_t> label = {"", 0};
  if (!json.is_object()) return label;
  if (json.contains("type") && json["type"].is_string())
    label.first = json["type"].get<std::string>().substr(0, 16);
  if (json.contains("id") && json["id"].is_number_integer()) label.second = json["id"].get<int64_t>();
  return label;
}

double pixels_of(const Look& look) { return static_cast<double>(look.width) * look.height; }

}  // namespace

Outgoing text_message(std::string text) {
  return {std::make_shared<const std::string>(std::move(text)), false};
}

Outgoing picture_message(const Json& json, const std::string& picture) {
  const std::string header = dump(json);
  const auto length = static_cast<uint32_t>(header.size());
  std::string bytes;
  bytes.reserve(4 + header.size() + picture.size());
  for (int byte = 0; byte < 4; ++byte) bytes += static_cast<char>((length >> (8 * byte)) & 255);
  bytes += header;
  bytes += picture;
  return {std::make_shared<const std::string>(std::move(bytes)), true};
}

void Audience::send_to(Guest& guest, const std::string& text) { guest.send(text_message(text)); }

void Audience::send_to_all(const std::string& text) {
  const Outgoing message = text_message(text);
  for (auto& [number, guest] : guests_) guest.send(message);
}

std::string Audience::state_text() const {
  return dump({{"type", "state"},
               {"paused", state_.paused},
               {"over", state_.over},
               {"iteration", state_.iteration},
               {"iterations", state_.iterations},
               {"surfels", {{"main", state_.main_surfels}, {"environment", state_.environment_surfels}}},
               {"viewers", guests_.size()}});
}

void Audience::enter(uint64_t number, Send send) {
  const std::lock_guard lock(mutex_);
  Guest& guest = guests_[number];
  guest.send = std::move(send);
  if (!hello_.empty()) send_to(guest, hello_);
  send_to(guest, events_text(history_.lines(), true));
  if (!troubles_.empty()) send_to(guest, trouble_text());
  send_to_all(state_text());
}

void Audience::leave(uint64_t number) {
  const std::lock_guard lock(mutex_);
  guests_.erase(number);
  send_to_all(state_text());
}

void Audience::hear(uint64_t number, std::string_view text) {
  Request request;
  try {
    request = parse_request(text);
  } catch (const InputError& error) {
    const auto [type, id] = label_of(text);
    refuse(number, type, id, error.what());
    return;
  }
  if (const auto* command = std::get_if<Command>(&request)) {
    if (on_command_) {
      on_command_(command->what);
    } else {
      refuse(number, "command", 0, "nothing is being trained here");
    }
    changed_.notify_all();
    return;
  }
  const std::lock_guard lock(mutex_);
  const auto found = guests_.find(number);
  if (found != guests_.end()) answer(found->second, request);
  changed_.notify_all();
}

void Audience::answer(Guest& guest, const Request& request) {
  const auto ask = [&](const auto& question) {
    if (guest.asked.size() >= most_asked) {
      send_to(guest, dump({{"type", "refused"}, {"request", ""}, {"id", 0}, {"text", "too many questions"}}));
    } else {
      guest.asked.emplace_back(question);
    }
  };
  std::visit(
      [&](const auto& r) {
        using R = std::decay_t<decltype(r)>;
        if constexpr (std::is_same_v<R, Look>) {
          guest.look = r;
          guest.asleep = false;
          guest.shown_divisor = std::numeric_limits<double>::infinity();
          guest.shown_final = false;
        } else if constexpr (std::is_same_v<R, Sleep>) {
          guest.asleep = true;
        } else if constexpr (std::is_same_v<R, Seen>) {
          const Clock::time_point now = Clock::now();
          while (!guest.on_their_way.empty() && guest.on_their_way.front().frame <= r.frame) {
            const Sent& sent = guest.on_their_way.front();
            guest.pacer.carried(sent.bytes, std::chrono::duration<double>(now - sent.when).count());
            guest.on_their_way.pop_front();
          }
        } else if constexpr (!std::is_same_v<R, Command>) {
          ask(r);
        }
      },
      request);
}

void Audience::greet_with(std::string hello) {
  const std::lock_guard lock(mutex_);
  if (hello == hello_) return;
  hello_ = std::move(hello);
  send_to_all(hello_);
}

void Audience::set_state(const State& state) {
  const std::lock_guard lock(mutex_);
  if (state == state_) return;
  state_ = state;
  send_to_all(state_text());
}

void Audience::tell(const std::vector<std::string>& events, bool reset) {
  const std::lock_guard lock(mutex_);
  if (reset) history_.clear();
  for (const std::string& line : events) history_.add(line);
  if (reset) {
    send_to_all(events_text(history_.lines(), true));
  } else if (!events.empty()) {
    send_to_all(events_text(events, false));
  }
}

std::string Audience::trouble_text() const {
  std::string all;
  for (const auto& [about, text] : troubles_) all += (all.empty() ? "" : " ") + text;
  return dump({{"type", "trouble"}, {"text", all}});
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
  send_to_all(trouble_text());
}

void Audience::scene_changed(Clock::duration refresh) {
  const std::lock_guard lock(mutex_);
  ++scene_;
  refresh_ = refresh;
}

bool Audience::wants_frame(const Guest& guest, Clock::time_point now) const {
  if (!guest.look || guest.asleep || guest.on_their_way.size() >= most_on_their_way) return false;
  const bool nothing_shown = guest.shown_divisor == std::numeric_limits<double>::infinity();
  if (nothing_shown) return true;
  if (guest.look->moving) return false;
  if (!guest.shown_final) return true;
  return guest.shown_scene != scene_ && now - guest.served >= refresh_;
}

bool Audience::has_job(Clock::time_point now) {
  return std::any_of(guests_.begin(), guests_.end(), [&](const auto& entry) {
    return !entry.second.asked.empty() || wants_frame(entry.second, now);
  });
}

bool Audience::wait(Clock::duration timeout) {
  std::unique_lock lock(mutex_);
  if (has_job(Clock::now())) return true;
  changed_.wait_for(lock, timeout);
  return has_job(Clock::now());
}

std::optional<Job> Audience::ask_of(uint64_t number, Guest& guest) {
  const auto question = guest.asked.front();
  guest.asked.pop_front();
  if (const auto* photo = std::get_if<Photo>(&question)) return Job{number, *photo};
  if (const auto* path = std::get_if<Path>(&question)) return Job{number, *path};
  const auto* probe = std::get_if<Probe>(&question);
  const auto* still = std::get_if<Still>(&question);
  if (!guest.look) {
    send_to(guest, dump({{"type", "refused"},
                         {"request", probe != nullptr ? "probe" : "still"},
                         {"id", probe != nullptr ? probe->id : still->id},
                         {"text", "nothing has been looked at yet"}}));
    return std::nullopt;
  }
  if (probe != nullptr) return Job{number, ProbeJob{*guest.look, *probe}};
  return Job{number, StillJob{*guest.look, *still}};
}

std::optional<Job> Audience::next() {
  const std::lock_guard lock(mutex_);
  for (auto& [number, guest] : guests_) {
    while (!guest.asked.empty()) {
      if (auto job = ask_of(number, guest)) return job;
    }
  }
  const Clock::time_point now = Clock::now();
  std::pair<const uint64_t, Guest>* longest_waiting = nullptr;
  for (auto& entry : guests_) {
    if (!wants_frame(entry.second, now)) continue;
    if (longest_waiting == nullptr || entry.second.served < longest_waiting->second.served)
      longest_waiting = &entry;
  }
  if (longest_waiting == nullptr) return std::nullopt;
  Guest& guest = longest_waiting->second;
  const Look& look = *guest.look;
  Coarseness coarseness;
  const bool refresh = guest.shown_final && guest.shown_scene != scene_;
  if (look.moving || guest.shown_divisor == std::numeric_limits<double>::infinity()) {
    coarseness = guest.pacer.moving(pixels_of(look));
  } else if (!refresh) {
    coarseness = guest.pacer.finer(pixels_of(look), guest.shown_divisor);
  }
  guest.served = now;
  return Job{longest_waiting->first, FrameJob{look, coarseness}};
}

void Audience::show_frame(const Job& job, nlohmann::ordered_json header, const std::string& picture,
                          double pixels, double seconds) {
  const FrameJob& made = std::get<FrameJob>(job.what);
  const std::lock_guard lock(mutex_);
  const auto found = guests_.find(job.guest);
  if (found == guests_.end()) return;
  Guest& guest = found->second;
  header["frame"] = ++guest.frames;
  const Outgoing message = picture_message(header, picture);
  const auto bytes = static_cast<double>(message.bytes->size());
  guest.pacer.made(pixels, seconds, bytes);
  guest.on_their_way.push_back({guest.frames, bytes, Clock::now()});
  guest.send(message);
  guest.served = Clock::now();
  // A newer Look may have come while this one was rendered.
  if (guest.look && guest.look->id == made.look.id) {
    guest.shown_divisor = made.coarseness.divisor;
    guest.shown_final = made.coarseness.final;
    guest.shown_scene = scene_;
  }
}

void Audience::reply(uint64_t number, Outgoing message) {
  const std::lock_guard lock(mutex_);
  const auto found = guests_.find(number);
  if (found != guests_.end()) found->second.send(std::move(message));
}

void Audience::refuse(uint64_t number, const std::string& request, int64_t id, const std::string& why) {
  reply(number, text_message(dump({{"type", "refused"}, {"request", request}, {"id", id}, {"text", why}})));
}

void Audience::refuse(const Job& job, const std::string& why) {
  std::visit(Overloaded{[&](const FrameJob& frame) { refuse_look(job.guest, frame.look.id, why); },
                        [&](const ProbeJob& probe) { refuse(job.guest, "probe", probe.probe.id, why); },
                        [&](const StillJob& still) { refuse(job.guest, "still", still.still.id, why); },
                        [&](const Photo&) { refuse(job.guest, "photo", 0, why); },
                        [&](const Path& path) { refuse(job.guest, "path", path.id, why); }},
             job.what);
}

void Audience::refuse_look(uint64_t number, int64_t id, const std::string& why) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = guests_.find(number);
    // A Look that cannot be shown is not tried again.
    if (found != guests_.end() && found->second.look && found->second.look->id == id)
      found->second.look.reset();
  }
  refuse(number, "look", id, why);
}

int64_t Audience::viewers() {
  const std::lock_guard lock(mutex_);
  return static_cast<int64_t>(guests_.size());
}

bool Audience::anybody_looks() {
  const std::lock_guard lock(mutex_);
  return std::any_of(guests_.begin(), guests_.end(), [](const auto& entry) { return !entry.second.asleep; });
}

}  // namespace traceflow::serve
