#pragma once

#include <vector>

#include "render/frame.h"
#include "render/render_options.h"

namespace traceflow::viz {

// Where P points of a scene have lately been, at V times each. On the host.
struct Tracks {
  std::vector<float> age;  // V, ascending from 0, the present: how many times of the capture ago
  float oldest = 1;        // the age at which a path has faded away
  std::vector<float> hue;  // P, 0 to 1: a point has the same at every time
  Tensor<float> position;  // V×P×3, world

  int64_t count() const { return static_cast<int64_t>(hue.size()); }
};

// Follows main surfels that move, over the times of a capture. Which ones is found once, by how far they move
// over the whole film, so that every picture of a film has the same. The same at any number of threads.
class TrackFollower {
 public:
  // request: which parts of the scene take part. times: the capture's, ascending; empty where they are not
  // known: then the keys of the bodies' motion or, without bodies, 60 even steps.
  TrackFollower(const Scene& scene, const FrameRequest& request, const RenderOptions& options,
                std::vector<float> times);

  // The paths that lead to where the points are at `time`. The scene is the same as before.
  Tracks at(const Scene& scene, float time) const;

  // P, the rows of the points among the stored main surfels, ascending. Where the scene is.
  const Tensor<int32_t>& chosen() const { return chosen_; }

 private:
  struct Places {
    Tensor<float> position, opacity;  // M×3, M, on the host
  };
  Places places(const Scene& scene, float time, const Tensor<int32_t>& rows) const;
  // Opaque surfels that something may move.
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
