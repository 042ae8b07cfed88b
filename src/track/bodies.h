#pragma once

#include <optional>

#include "capture/capture.h"
#include "scene/lighting.h"
#include "scene/motion.h"
#include "scene/nodes.h"
#include "scene/surfels.h"

// Assigns surfels to bodies by the capture's masks.
namespace traceflow {

// The fixed opacity of the points of bodies during tracking. If it were trained, surfels in front would fade,
// larger ones behind would show through, and the visible surface would recede.
inline constexpr float solid_opacity = 0.95F;
// Sets that opacity for all surfels of bodies. Narrows them to 0.6 of their width, or of 1.5 times their
// body's median if that is less. An opaque surfel is visible up to 1.1 of its width from its centre. At full
// width, surfels on unseen sides would stick out when they reach the outline, and silhouettes would push the
// body away.
void make_solid(const Motion& motion, Surfels& surfels);

// Points (P×3) for each part of the earliest mask that shows a thing without points: at the depths of the
// view's prior, or of an inflated surface (track/inflation.h) if there is none. That is a part with fewer
// than 24 of `points` (P×3), with points farther away than what is beside it, or with mostly static points.
Tensor<float> points_on_bare_things(const Capture& capture, const Tensor<float>& points);

// One body for each connected part of the earliest mask. A body gets the surfels that project into the part
// and lie no farther behind its front than it is wide. The body of a thing without points gets the surfels at
// its invented points, which are those from row `points` on. Sets surfels.body and returns bodies at rest at
// the times of the training views. Returns nothing if no part has enough surfels.
std::optional<Motion> find_bodies(const Capture& capture, int64_t points, Surfels& surfels);

// Releases surfels that the motion of their body moves out of the masks of the views up to the time `latest`:
// they lay behind or beside the body. surfels and motion are on the CPU. Returns the number of released
// surfels.
int64_t release_strays(const Capture& capture, const Motion& motion, float latest, Surfels& surfels);

// Deformation nodes, up to `each` per body. They are spread evenly over the body's surfels with an opacity
// above one half, and are at rest at every `every`th time of the motion. surfels and motion are on the CPU.
Nodes place_nodes(const Motion& motion, const Surfels& surfels, int64_t each, int64_t every);

// The nodes of the selected bodies (one value per body). On the CPU.
Nodes nodes_of(const Nodes& nodes, const std::vector<bool>& bodies);

// Copies the poses of a body and the motion of its nodes. On the CPU.
void take_body(int32_t body, const Motion& from, const Nodes& nodes_from, Motion& motion, Nodes& nodes);

// Sets the anchors of a body's nodes (ops/motion/nodes.h) to their current positions. On the CPU.
void anchor_nodes(const Motion& motion, int32_t body, Nodes& nodes);

// Unchanged light in the box around all places of the bodies' opaque surfels, at every `every`th time of the
// motion. The box has a margin of 0.4 of its longest side in each direction. cells: along the longest side.
// on_bodies: also on bodies. On the CPU.
Lighting lighting_around(const Motion& motion, const Surfels& surfels, int64_t cells, int64_t every,
                         bool on_bodies);
// Sets the centre of the light on each body to the mean of its opaque surfels at each time, and its radius to
// their root mean square distance from it at the first time. On the CPU.
void carry_lighting(const Motion& motion, const Surfels& surfels, Lighting& lighting);

// The differences between renders and photographs at surfels outside bodies.
struct Unrest {
  std::vector<double> sum;  // of squared differences, per surfel
  std::vector<int> count;   // number of views, per surfel

  // Adds one view: colour H×W×3, alpha and depth (Σ w z) H×W, on the CPU. main: the surfels, which are static
  // outside bodies. Hidden surfels and those near a mask are left out.
  void look(const Surfels& main, const View& view, const ViewImages& images, const Tensor<float>& colour,
            const Tensor<float>& alpha, const Tensor<float>& depth);
};
// Marks static surfels: those whose difference is at most three times the median or at most 0.1, and those
// with fewer than ten moving ones among their 16 nearest neighbours. Returns their number. On the CPU.
int64_t mark_still(const Unrest& unrest, Surfels& surfels);

}  // namespace traceflow
