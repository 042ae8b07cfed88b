#pragma once

#include <map>
#include <memory>

#include "render/renderer.h"
#include "serve/clients/clients.h"
#include "serve/scene_view.h"
#include "viz/picture.h"

namespace traceflow::serve {

// Renders the pictures that pages request and answers their other requests, on the thread that owns the
// scene.
class FrameServer {
 public:
  FrameServer(Clients& clients, SceneInfo info) : clients_(clients), info_(std::move(info)) {}

  // Sends the hello message to every page, now and later.
  void send_hello(const SceneView& view);
  // Serves one job. Errors are sent to the page as text; nothing is thrown.
  void answer(const Job& job, const SceneView& view);
  // Call before the scene changes. Drops what was computed from it and, on a CUDA device, frees the memory
  // that training may need.
  void scene_changed(Device device);
  // Call when another scene is shown.
  void forget();

 private:
  void answer(const Job& job, const FrameJob& frame, const SceneView& view);
  void answer(const Job& job, const StillJob& still, const SceneView& view);
  void answer(const Job& job, const ProbeJob& probe, const SceneView& view);
  void answer(const Job& job, const Photo& photo, const SceneView& view);
  void answer(const Job& job, const Path& path, const SceneView& view);

  FrameRequest request_for(const ViewRequest& view_request, const SceneView& view, double divisor) const;
  // The capture's photograph, on the host. Throws InputError.
  std::shared_ptr<const ViewImages> photograph(const PhotoRef& photo) const;
  // The picture of a ViewRequest as 8-bit colours.
  Tensor<uint8_t> picture(const ViewRequest& view_request, const FrameRequest& request, const SceneView& view,
                          viz::Painter& painter);
  Renderer& renderer(const SceneView& view);
  viz::Tracks tracks(const FrameRequest& request, const SceneView& view);

  Clients& clients_;
  SceneInfo info_;
  std::unique_ptr<Renderer> renderer_;
  std::optional<viz::TrackFollower> follower_;  // for this scene; made when a page requests tracks
  bool posed_ = false;                          // whether the renderer has posed the present scene
  std::map<uint64_t, viz::Painter> painters_;   // one per page: its value ranges adapt to what the page sees
};

}  // namespace traceflow::serve
