#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "scene/viewpoint.h"

// The messages from a page over the WebSocket (docs/view.md, web/src/messages.ts). Units and axes are the
// capture's: camera axes x right, y down, z forward.
namespace traceflow::serve {

// One of the capture's views.
struct PhotoRef {
  bool test = false;  // of the test split, else of the training split
  int64_t index = 0;
  bool operator==(const PhotoRef&) const = default;
};

// The camera and settings of frames from now on.
struct ViewRequest {
  int64_t id = 0;
  std::variant<Viewpoint, PhotoRef> camera;
  float time = 0;             // 0 to 1
  int width = 0, height = 0;  // pixels, for a resting camera
  std::string layer = "rgb";
  float exposure = 0;  // stops
  std::string map = "viridis";
  bool moving = false;  // the camera moves: another ViewRequest follows soon
};

// The page is hidden: nothing is rendered until the next ViewRequest.
struct Sleep {};

// The page has displayed a frame.
struct FrameShown {
  int64_t frame = 0;
};

// Asks what the ray through a point of the last ViewRequest's picture hits; x and y from 0 (left, top) to 1.
struct Probe {
  int64_t id = 0;
  double x = 0, y = 0;
};

// Asks for the picture of the last ViewRequest as a PNG.
struct Still {
  int64_t id = 0;
  int width = 0, height = 0;
};

// Asks for a photograph.
struct Photo {
  PhotoRef photo;
  int width = 0;  // maximum width in pixels
};

// Asks for the cameras along a camera path.
struct Path {
  int64_t id = 0;
  std::string path;  // JSON text, as in the file for `render --camera-path`
};

enum class Action { pause, resume, save, stop };
struct Command {
  Action action = Action::pause;
};

using Request = std::variant<ViewRequest, Sleep, FrameShown, Probe, Still, Photo, Path, Command>;

// Throws InputError with the field for text that is not JSON, has no known type, lacks a field, or has values
// out of range.
Request parse_request(std::string_view text);

}  // namespace traceflow::serve
