#include "serve/clients/messages.h"

#include <nlohmann/json.hpp>

#include "files/json_document.h"

namespace traceflow::serve {

namespace {

constexpr int64_t largest_id = int64_t{1} << 53;
constexpr int look_side = 4096;
constexpr int still_side = 8192;
constexpr size_t longest_word = 64;

PhotoRef photo_of(const JsonField& message) {
  const std::string split = message["split"].text(longest_word);
  if (split != "train" && split != "test") message["split"].fail(split, "train or test");
  return {split == "test", message["index"].whole(0, 1'000'000)};
}

Look look_of(const JsonField& message) {
  Look look;
  look.id = message["id"].whole(0, largest_id);
  if (message.has("photo")) {
    look.camera = photo_of(message["photo"]);
  } else {
    const JsonField camera = message["camera"];
    look.camera = Viewpoint{camera["position"].vector(), camera["rotation"].rotation(),
                            camera["fov_y"].number(0.1, 170)};
  }
  look.time = static_cast<float>(message["time"].number(0, 1));
  look.width = static_cast<int>(message["width"].whole(1, look_side));
  look.height = static_cast<int>(message["height"].whole(1, look_side));
  look.layer = message["layer"].text(longest_word);
  look.exposure = static_cast<float>(message["exposure"].number(-10, 10));
  look.map = message["map"].text(longest_word);
  look.moving = message["moving"].yes();
  return look;
}

Still still_of(const JsonField& message) {
  return {message["id"].whole(0, largest_id), static_cast<int>(message["width"].whole(1, still_side)),
          static_cast<int>(message["height"].whole(1, still_side))};
}

Command command_of(const JsonField& message) {
  const std::string word = message["do"].text(longest_word);
  if (word == "pause") return {Do::pause};
  if (word == "resume") return {Do::resume};
  if (word == "save") return {Do::save};
  if (word == "stop") return {Do::stop};
  message["do"].fail(word, "pause, resume, save or stop");
}

}  // namespace

Request parse_request(std::string_view text) {
  const JsonDocument message("message", text);
  const std::string type = message["type"].text(longest_word);
  if (type == "look") return look_of(message);
  if (type == "sleep") return Sleep{};
  if (type == "seen") return Seen{message["frame"].whole(0, largest_id)};
  if (type == "probe") {
    return Probe{message["id"].whole(0, largest_id), message["x"].number(0, 1), message["y"].number(0, 1)};
  }
  if (type == "still") return still_of(message);
  if (type == "photo")
    return Photo{photo_of(message), static_cast<int>(message["width"].whole(1, look_side))};
  if (type == "path") return Path{message["id"].whole(0, largest_id), message["path"].json().dump()};
  if (type == "command") return command_of(message);
  message["type"].fail(type, "look, sleep, seen, probe, still, photo, path or command");
}

}  // namespace traceflow::serve
