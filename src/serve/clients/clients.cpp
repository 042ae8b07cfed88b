#include "serve/clients/clients.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/overloaded.h"

namespace traceflow::serve {

namespace {

// The type and number of a message that could not be parsed, so that the page can relate the refusal to it.
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
  return std::visit(Overloaded{[](const FrameJob& frame) { return Label("view", frame.view_request.id); },
                               [](const ProbeJob& probe) { return Label("probe", probe.probe.id); },
                               [](const StillJob& still) { return Label("still", still.still.id); },
                               [](const Photo&) { return Label("photo", 0); },
                               [](const Path& path) { return Label("path", path.id); }},
                    job.what);
}

}  // namespace

Client* Clients::find(uint64_t number) {
  const auto found = clients_.find(number);
  return found == clients_.end() ? nullptr : &found->second;
}

void Clients::broadcast(const Outgoing& message) {
  for (const auto& [number, client] : clients_) client.send(message);
}

Outgoing Clients::state_message() const {
  return json_message(
      {{"type", "state"},
       {"paused", state_.paused},
       {"over", state_.over},
       {"iteration", state_.iteration},
       {"iterations", state_.iterations},
       {"surfels", {{"main", state_.main_surfels}, {"environment", state_.environment_surfels}}},
       {"viewers", clients_.size()}});
}

Outgoing Clients::warning_message() const {
  std::string all;
  for (const auto& [about, text] : warnings_) all += (all.empty() ? "" : " ") + text;
  return json_message({{"type", "warning"}, {"text", all}});
}

void Clients::on_connect(uint64_t number, Send send) {
  const std::lock_guard lock(mutex_);
  const Client& client = clients_.try_emplace(number, number, std::move(send)).first->second;
  if (!hello_.empty()) client.send(text_message(hello_));
  client.send(text_message(events_text(history_.lines(), true)));
  if (!warnings_.empty()) client.send(warning_message());
  broadcast(state_message());
}

void Clients::on_disconnect(uint64_t number) {
  const std::lock_guard lock(mutex_);
  clients_.erase(number);
  broadcast(state_message());
}

void Clients::on_message(uint64_t number, std::string_view text) {
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
      on_command_(command->action);
    } else {
      reply(number, refusal("command", 0, "nothing is being trained here"));
    }
  } else {
    const std::lock_guard lock(mutex_);
    if (Client* client = find(number)) answer(*client, request);
  }
  changed_.notify_all();
}

void Clients::answer(Client& client, const Request& request) {
  std::visit(Overloaded{[&](const ViewRequest& view) { client.request_view(view); },
                        [&](const Sleep&) { client.sleep(); },
                        [&](const FrameShown& shown) { client.frame_shown(shown.frame, Clock::now()); },
                        [](const Command&) {},
                        [&](const auto& question) {
                          if (!client.ask(question)) client.send(refusal("", 0, "too many questions"));
                        }},
             request);
}

void Clients::set_hello(std::string hello) {
  const std::lock_guard lock(mutex_);
  if (hello == hello_) return;
  hello_ = std::move(hello);
  broadcast(text_message(hello_));
}

void Clients::set_state(const State& state) {
  const std::lock_guard lock(mutex_);
  if (state == state_) return;
  state_ = state;
  broadcast(state_message());
}

void Clients::add_log_lines(const std::vector<std::string>& events, bool reset) {
  const std::lock_guard lock(mutex_);
  if (reset) history_.clear();
  for (const std::string& line : events) history_.add(line);
  if (reset) {
    broadcast(text_message(events_text(history_.lines(), true)));
  } else if (!events.empty()) {
    broadcast(text_message(events_text(events, false)));
  }
}

void Clients::set_warning(const std::string& about, const std::string& text) {
  const std::lock_guard lock(mutex_);
  const auto known = warnings_.find(about);
  if (text == (known == warnings_.end() ? "" : known->second)) return;
  if (text.empty()) {
    warnings_.erase(known);
  } else {
    warnings_[about] = text;
  }
  broadcast(warning_message());
}

void Clients::scene_changed(Clock::duration refresh) {
  const std::lock_guard lock(mutex_);
  ++scene_.number;
  scene_.refresh = refresh;
}

bool Clients::has_job(Clock::time_point now) {
  return std::ranges::any_of(clients_, [&](const auto& entry) {
    return entry.second.has_question() || entry.second.wants_frame({}, scene_, now);
  });
}

bool Clients::wait(Clock::duration timeout) {
  std::unique_lock lock(mutex_);
  if (has_job(Clock::now())) return true;
  changed_.wait_for(lock, timeout);
  return has_job(Clock::now());
}

std::optional<Job> Clients::next(const Allowed& allowed) {
  const std::lock_guard lock(mutex_);
  for (auto& [number, client] : clients_) {
    while (client.has_question()) {
      if (auto job = client.next_question()) return job;
    }
  }
  const Clock::time_point now = Clock::now();
  Client* longest_waiting = nullptr;
  for (auto& [number, client] : clients_) {
    if (!client.wants_frame(allowed, scene_, now)) continue;
    if (longest_waiting == nullptr || client.served() < longest_waiting->served()) longest_waiting = &client;
  }
  if (longest_waiting == nullptr) return std::nullopt;
  return longest_waiting->next_frame(now);
}

void Clients::show_frame(const Job& job, nlohmann::ordered_json header, const std::string& picture,
                         double pixels, double seconds) {
  const std::lock_guard lock(mutex_);
  Client* client = find(job.client);
  if (client == nullptr) return;
  header["frame"] = client->next_number();
  client->show(std::get<FrameJob>(job.what), picture_message(header, picture), pixels, seconds, scene_);
}

void Clients::reply(uint64_t number, const Outgoing& message) {
  const std::lock_guard lock(mutex_);
  if (const Client* client = find(number)) client->send(message);
}

void Clients::refuse(const Job& job, const std::string& why) {
  const auto [type, id] = label_of(job);
  const std::lock_guard lock(mutex_);
  Client* client = find(job.client);
  if (client == nullptr) return;
  if (std::holds_alternative<FrameJob>(job.what)) client->drop_view(id);
  client->send(refusal(type, id, why));
}

void Clients::no_memory_for(const Job& job) {
  const std::lock_guard lock(mutex_);
  if (Client* client = find(job.client)) client->no_memory_for(std::get<FrameJob>(job.what), Clock::now());
}

bool Clients::any_lacks_memory() {
  const std::lock_guard lock(mutex_);
  const Clock::time_point now = Clock::now();
  return std::ranges::any_of(clients_, [&](const auto& entry) { return entry.second.lacks_memory(now); });
}

bool Clients::is_connected(uint64_t number) {
  const std::lock_guard lock(mutex_);
  return clients_.contains(number);
}

int64_t Clients::viewers() {
  const std::lock_guard lock(mutex_);
  return static_cast<int64_t>(clients_.size());
}

bool Clients::any_awake() {
  const std::lock_guard lock(mutex_);
  return std::ranges::any_of(clients_, [](const auto& entry) { return entry.second.is_awake(); });
}

}  // namespace traceflow::serve
