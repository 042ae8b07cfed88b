#pragma once

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "serve/net/message_handler.h"

namespace traceflow::serve::testing {

// What a page has been sent: a message, or the header of a picture with the picture.
struct Received {  // NOLINT(bugprone-exception-escape): its JSON is moved without any
  nlohmann::json json;
  std::string picture;
};

// A page without a browser: it keeps what it is sent. Its address must not change.
class FakePage {
 public:
  FakePage(MessageHandler& handler, uint64_t number) : handler_(handler), number_(number) {
    handler_.on_connect(number_, [this](const Outgoing& message) { take(message); });
  }
  ~FakePage() { leave(); }
  FakePage(const FakePage&) = delete;
  FakePage& operator=(const FakePage&) = delete;

  void say(const nlohmann::json& message) { handler_.on_message(number_, message.dump()); }
  void say_text(const std::string& text) { handler_.on_message(number_, text); }
  void leave() {
    if (here_) handler_.on_disconnect(number_);
    here_ = false;
  }

  std::vector<Received> all() const {
    const std::lock_guard lock(mutex_);
    return received_;
  }
  std::vector<Received> of(const std::string& type) const {
    std::vector<Received> found = all();
    std::erase_if(found, [&](const Received& r) { return r.json["type"] != type; });
    return found;
  }
  // Waits until it has got `count` of a type. The limit only ends a test that has failed.
  bool wait_for(const std::string& type, size_t count) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(60), [&] {
      return std::count_if(received_.begin(), received_.end(), [&](const Received& r) {
               return r.json["type"] == type;
             }) >= static_cast<std::ptrdiff_t>(count);
    });
  }
  // Says that all frames so far have been shown.
  void acknowledge_frames() {
    int64_t last = 0;
    for (const Received& frame : of("frame")) last = frame.json["frame"].get<int64_t>();
    say({{"type", "frame_shown"}, {"frame", last}});
  }

 private:
  void take(const Outgoing& message) {
    Received received;
    const std::string& bytes = *message.bytes;
    if (message.binary) {
      size_t length = 0;
      for (size_t i = 0; i < 4; ++i)
        length |= static_cast<size_t>(static_cast<unsigned char>(bytes.at(i))) << (8 * i);
      received.json = nlohmann::json::parse(bytes.substr(4, length));
      received.picture = bytes.substr(4 + length);
    } else {
      received.json = nlohmann::json::parse(bytes);
    }
    const std::lock_guard lock(mutex_);
    received_.push_back(std::move(received));
    changed_.notify_all();
  }

  MessageHandler& handler_;
  uint64_t number_;
  bool here_ = true;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Received> received_;
};

inline nlohmann::json view_request(int64_t id, bool moving = false) {
  return {
      {"type", "view"},
      {"id", id},
      {"camera", {{"position", {0, 0, -3}}, {"rotation", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, {"fov_y", 45}}},
      {"time", 0},
      {"width", 96},
      {"height", 64},
      {"layer", "rgb"},
      {"exposure", 0},
      {"map", "viridis"},
      {"moving", moving}};
}

}  // namespace traceflow::serve::testing
