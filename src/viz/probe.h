#pragma once

#include <optional>

#include "render/renderer.h"

namespace traceflow::viz {

// What the ray through a pixel meets. Lengths in scene units, world axes.
struct ProbeResult {
  // The ray as the surface mirrors it; of several samples in a pixel the first that is traced.
  struct Mirrored {
    Vec3<float> direction;  // unit
    float alpha =
        0;  // how much of its light comes from surfels; 0 with an environment map, which is far away
    float distance = 0;  // mean distance of those from the surface; 0 where alpha is 0
    Vec3<float> end;     // the place at that distance
  };

  Vec3<float> surface, normal;  // the surface's point and unit normal
  float depth = 0;              // along the camera's z, as the layer has it
  float alpha = 0, tint = 0;
  Vec3<float> colour, diffuse;
  Vec3<float> specular{0};           // black where nothing was traced
  std::optional<Mirrored> mirrored;  // where a reflection was traced
};

// What the pixel at (x, y), in pixels from the picture's upper left corner, shows of a request. Nothing where
// no surface is: off the picture, or where alpha is under the least that can reflect. Overwrites the
// renderer's frame. Costs what posing does, or little with reuse_pose.
std::optional<ProbeResult> probe(Renderer& renderer, const Scene& scene, const FrameRequest& request,
                                 double x, double y);

// The same in the capture's own units.
ProbeResult in_capture(ProbeResult result, const SceneNormalisation& normalisation);

}  // namespace traceflow::viz
