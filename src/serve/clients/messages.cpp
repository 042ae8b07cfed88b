#include "serve/clients/messages.h"

#include <nlohmann/json.hpp>

#include "files/json_document.h"

namespace traceflow::serve {

namespace {

constexpr int64_t largest_id = int64_t{1} << 53;
constexpr int view_side = 4096;
constexpr int still_side = 8192;
constexpr size_t longest_word = 64;

PhotoRef photo_of(const JsonField& message) {
  const std::string split = message["split"].text(longest_word);
  if (split != "train" && split != "test") message["split"].fail(split, "train or test");
  return {split == "test", message["index"].whole(0, 1'000'000)};
}

ViewRequest view_request_of(const JsonField& message) {
  ViewRequest view;
  view.id = message["id"].whole(0, largest_id);
  if (message.has("photo")) {
    view.camera = photo_of(message["photo"]);
  } else {
    const JsonField camera = message["camera"];
    view.camera = Viewpoint{camera["position"].vector(), camera["rotation"].rotation(),
                            camera["fov_y"].number(0.1, 170)};
  }
  view.time = static_cast<float>(message["time"].number(0, 1));
  view.width = static_cast<int>(message["width"].whole(1, view_side));
  view.height = static_cast<int>(message["height"].whole(1, view_side));
  view.layer = message["layer"].text(longest_word);
  view.exposure = static_cast<float>(message["exposure"].number(-10, 10));
  view.map = message["map"].text(longest_word);
  view.moving = message["moving"].yes();
  return view;
}

Still still_of(const JsonField& message) {
  return {message["id"].whole(0, largest_id), static_cast<int>(message["width"].whole(1, still_side)),
          static_cast<int>(message["height"].whole(1, still_side))};
}

Command command_of(const JsonField& message) {
  const std::string word = message["do"].text(longest_word);
  if (word == "pause") return {Action::pause};
  if (word == "resume") return {Action::resume};
  if (word == "save") return {Action::save};
  if (word == "stop") return {Action::stop};
  message["do"].fail(word, "pause, resume, save or stop");
}

}  // namespace

Request parse_request(std::string_view text) {
  const JsonDocument message("message", text);
  const std::string type = message["type"].text(longest_word);
  if (type == "view") return view_request_of(message);
  if (type == "sleep") return Sleep{};
  if (type == "frame_shown") return FrameShown{message["frame"].whole(0, largest_id)};
  if (type == "probe") {
    return Probe{message["id"].whole(0, largest_id), message["x"].number(0, 1), message["y"].number(0, 1)};
  }
  if (type == "still") return still_of(message);
  if (type == "photo")
    return Photo{photo_of(message), static_cast<int>(message["width"].whole(1, view_side))};
  if (type == "path") return Path{message["id"].whole(0, largest_id), message["path"].json().dump()};
  if (type == "command") return command_of(message);
  message["type"].fail(type, "view, sleep, frame_shown, probe, still, photo, path or command");
}

}  // namespace traceflow::serve
