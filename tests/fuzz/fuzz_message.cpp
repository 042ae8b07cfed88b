// Bytes as what a page says over its live connection, a message in each line: read, kept by the clients, and
// turned into jobs.
#include <cstdint>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/overloaded.h"
#include "fuzz/promise.h"
#include "serve/clients/clients.h"

using namespace traceflow;
using fuzz::promise;

namespace {

void check(const serve::ViewRequest& view) {
  promise(view.id >= 0, "a number is not negative");
  promise(view.width >= 1 && view.width <= 4096 && view.height >= 1 && view.height <= 4096,
          "a size is in its range");
  promise(view.time >= 0 && view.time <= 1, "a time is in its range");
  promise(std::abs(view.exposure) <= 10, "an exposure is in its range");
  promise(view.layer.size() <= 64 && view.map.size() <= 64, "a word is short");
  const auto* free = std::get_if<Viewpoint>(&view.camera);
  if (free == nullptr)
    return promise(std::get<serve::PhotoRef>(view.camera).index >= 0, "an index is not negative");
  promise(free->fov_y > 0 && free->fov_y < 180, "an angle is in its range");
  promise(std::abs(determinant(free->world_from_camera) - 1) < 0.1, "a rotation is one");
  promise(length(free->position) < 1e17, "a position is finite");
}

void check(const serve::Request& request) {
  std::visit(Overloaded{[](const serve::ViewRequest& view) { check(view); },
                        [](const serve::Still& still) {
                          promise(still.width >= 1 && still.width <= 8192 && still.height >= 1 &&
                                      still.height <= 8192,
                                  "a still has a size");
                        },
                        [](const serve::Probe& probe) {
                          promise(probe.x >= 0 && probe.x <= 1 && probe.y >= 0 && probe.y <= 1,
                                  "a probe is in the picture");
                        },
                        [](const auto&) {}},
             request);
}

// Every message to a page is JSON, or begins with some.
void check(const serve::Outgoing& message) {
  const std::string& bytes = *message.bytes;
  if (message.binary) {
    promise(bytes.size() >= 4, "a picture has a header");
    return;
  }
  promise(nlohmann::json::accept(bytes), "what is sent is JSON");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  serve::Clients clients([](serve::Action) {});
  clients.set_hello("{}");
  clients.on_connect(1, [](const serve::Outgoing& message) { check(message); });
  while (!rest.empty()) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), line.size() + 1));
    try {
      check(serve::parse_request(line));
    } catch (const InputError&) {
    }
    clients.on_message(1, line);
    const auto job = clients.next();
    if (!job) continue;
    if (std::holds_alternative<serve::FrameJob>(job->what)) {
      clients.show_frame(*job, {{"type", "frame"}}, "picture", 100, 0.01);
    } else {
      clients.refuse(*job, "not here");
    }
  }
  int jobs = 0;
  while (clients.next() && jobs < 1000) ++jobs;
  clients.on_disconnect(1);
  promise(!clients.next(), "nothing is done for who has left");
  return 0;
}
