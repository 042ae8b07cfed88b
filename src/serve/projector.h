#pragma once

#include <map>
#include <memory>

#include "render/renderer.h"
#include "serve/audience/audience.h"
#include "serve/stage.h"
#include "show/picture.h"

namespace traceflow::serve {

// Makes the pictures that pages ask for and answers their questions, on the thread on which the scene stands
// still.
class Projector {
 public:
  Projector(Audience& audience, Setting setting) : audience_(audience), setting_(std::move(setting)) {}

  // Tells every page, now and later, what there is to see.
  void greet(const Stage& stage);
  // One job of the audience. What goes wrong is told to the pages in words; nothing is thrown.
  void answer(const Job& job, const Stage& stage);
  // The scene is about to change, or is another one: what is remembered of it is forgotten, and memory given
  // back that a training may need, on the CUDA device.
  void scene_changed(Device device);
  // It is another scene from now on.
  void forget();

 private:
  void answer(const Job& job, const FrameJob& frame, const Stage& stage);
  void answer(const Job& job, const StillJob& still, const Stage& stage);
  void answer(const Job& job, const ProbeJob& probe, const Stage& stage);
  void answer(const Job& job, const Photo& photo, const Stage& stage);
  void answer(const Job& job, const Path& path, const Stage& stage);

  FrameRequest request_for(const Look& look, const Stage& stage, double divisor) const;
  // As the capture has it, on the host. Throws InputError.
  std::shared_ptr<const ViewImages> photograph(const PhotoRef& photo) const;
  // What a Look shows, as 8-bit colours.
  Tensor<uint8_t> picture(const Look& look, const FrameRequest& request, const Stage& stage,
                          show::Painter& painter);
  Renderer& renderer(const Stage& stage);
  show::Tracks tracks(const FrameRequest& request, const Stage& stage);

  Audience& audience_;
  Setting setting_;
  std::unique_ptr<Renderer> renderer_;
  std::optional<show::TrackFollower> follower_;  // of the scene as it is now, once a page wants paths
  bool posed_ = false;                           // the renderer has seen the scene as it is now
  std::map<uint64_t, show::Painter> painters_;   // of every page, whose ranges follow what it sees
};

}  // namespace traceflow::serve
