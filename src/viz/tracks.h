#pragma once

#include <vector>

#include "render/frame.h"
#include "render/render_options.h"

namespace traceflow::viz {

// Recent positions of P points of a scene at V times. On the host.
struct Tracks {
  std::vector<float> age;  // V, ascending from 0, the present: age in times of the capture
  float oldest = 1;        // the age at which a track has faded
  std::vector<float> hue;  // P, 0 to 1: constant over time
  Tensor<float> position;  // V×P×3, world

  int64_t count() const { return static_cast<int64_t>(hue.size()); }
};

// Follows moving main surfels over the times of a capture. The surfels are chosen once, by how far they move
// over all times, so that every frame of a video has the same. The result does not depend on the number of
// threads.
class TrackFollower {
 public:
  // request: the parts of the scene to render. times: the capture's, ascending. If empty, the keys of the
  // bodies' motion or, without bodies, 60 even steps are used.
  TrackFollower(const Scene& scene, const FrameRequest& request, const RenderOptions& options,
                std::vector<float> times);

  // The tracks up to `time`. The scene must be the same as in the constructor.
  Tracks at(const Scene& scene, float time) const;

  // P×3: the points' positions at `time`, in the scene, on the host. The scene must be the same as in the
  // constructor.
  Tensor<float> positions(const Scene& scene, float time) const;
  // P, 0 to 1.
  const std::vector<float>& hues() const { return hue_; }

  // P, the points' rows among the stored main surfels, ascending. On the scene's device.
  const Tensor<int32_t>& chosen() const { return chosen_; }

 private:
  struct Places {
    Tensor<float> position, opacity;  // M×3, M, on the host
  };
  Places places(const Scene& scene, float time, const Tensor<int32_t>& rows) const;
  // Opaque surfels that may move.
  std::vector<int32_t> candidates(const Scene& scene) const;
  void choose(const Scene& scene);

  TracksOptions options_;
  field::Precision precision_;
  bool deforms_;
  std::vector<float> times_;
  Tensor<int32_t> chosen_;
  std::vector<float> hue_;
};

}  // namespace traceflow::viz
