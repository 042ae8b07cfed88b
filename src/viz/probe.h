#pragma once

#include <optional>

#include "render/renderer.h"

namespace traceflow::viz {

// What the ray through a pixel hits. Lengths in scene units, world axes.
struct ProbeResult {
  // The ray reflected at the surface. If a pixel has several samples, the first that is traced.
  struct Mirrored {
    Vec3<float> direction;  // unit
    float alpha =
        0;  // fraction of its light that comes from surfels; 0 with an environment map, which is at infinity
    float distance = 0;  // mean distance of these surfels from the surface; 0 if alpha is 0
    Vec3<float> end;     // the point at that distance
  };

  Vec3<float> surface, normal;  // point on the surface and unit normal
  float depth = 0;              // along the camera's z, as in the layer
  float alpha = 0, tint = 0;
  Vec3<float> colour, diffuse;
  Vec3<float> specular{0};           // black if nothing was traced
  std::optional<Mirrored> mirrored;  // if a reflection was traced
};

// Probes the pixel at (x, y), in pixels from the picture's upper left corner. Returns nothing if there is no
// surface: outside the picture, or where alpha is too small for a reflection. Overwrites the renderer's
// frame. Costs as much as posing, or little with reuse_pose.
std::optional<ProbeResult> probe(Renderer& renderer, const Scene& scene, const FrameRequest& request,
                                 double x, double y);

// The same in the capture's units.
ProbeResult in_capture(ProbeResult result, const SceneNormalisation& normalisation);

}  // namespace traceflow::viz
