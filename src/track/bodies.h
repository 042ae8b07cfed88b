#pragma once

#include <optional>

#include "capture/capture.h"
#include "scene/lighting.h"
#include "scene/motion.h"
#include "scene/nodes.h"
#include "scene/surfels.h"

// Which surfels move together, by the capture's masks.
namespace traceflow {

// The opacity of the points that bodies carry while they are followed. Where it learns, surfels of the front
// fade, larger ones behind them show through, and the surface that pictures show moves away.
inline constexpr float solid_opacity = 0.95F;
// Gives that opacity to all that bodies carry and narrows them to 0.6 of their width, or of 1.5 times their
// body's median. A solid surfel shows up to 1.1 of its width beyond its centre. Those on the sides that no
// picture has shown yet stick out when they come to the rim: silhouettes then push the body away.
void make_solid(const Motion& motion, Surfels& surfels);

// Points (P×3) of an inflated surface (track/inflation.h) for each part of the earliest mask that shows a
// thing without points: fewer than 24 of `points` (P×3) lie in it, or what lies there is farther away than
// what stands beside it, or most of it are standing points.
Tensor<float> points_on_bare_things(const Capture& capture, const Tensor<float>& points);

// A body for each connected part of the earliest mask. It carries the surfels that project into the part and
// lie no farther behind its front than it is wide; of a thing without points it carries those that stand at
// points made up for it, which are surfels from row `points` on. Sets surfels.body and returns bodies that
// stand still at the times of the training views; nothing where no part has enough surfels.
std::optional<Motion> find_bodies(const Capture& capture, int64_t points, Surfels& surfels);

// Lets carried surfels go that their body takes out of the masks of the views up to the time
// `latest`: they lay behind it, or beside it. surfels and motion on the CPU. Returns how many.
int64_t release_strays(const Capture& capture, const Motion& motion, float latest, Surfels& surfels);

// Nodes that let bodies bend, up to `each` of every body: spread evenly over its surfels of an opacity above
// one half, at rest at every `every`th time of the motion. surfels and motion on the CPU.
Nodes place_nodes(const Motion& motion, const Surfels& surfels, int64_t each, int64_t every);

// Those of the bodies that are meant (one value a body). On the CPU.
Nodes nodes_of(const Nodes& nodes, const std::vector<bool>& bodies);

// Takes a body's poses, and what its nodes do, from elsewhere. On the CPU.
void take_body(int32_t body, const Motion& from, const Nodes& nodes_from, Motion& motion, Nodes& nodes);

// Training keeps a body's nodes where they are now (ops/motion/nodes.h). On the CPU.
void anchor_nodes(const Motion& motion, int32_t body, Nodes& nodes);

// Light that has not changed yet, in the box around all places of the bodies' opaque surfels, wider by 0.4 of
// its longest side in each direction, at every `every`th time of the motion. cells: along the longest side.
// on_bodies: on bodies too. On the CPU.
Lighting lighting_around(const Motion& motion, const Surfels& surfels, int64_t cells, int64_t every,
                         bool on_bodies);
// Sets the middle of light on each body to that of its opaque surfels at each time, and the radius to the
// root of their mean squared distance from it at the first time. On the CPU.
void carry_lighting(const Motion& motion, const Surfels& surfels, Lighting& lighting);

// How far pictures are from the photographs where surfels show that no body carries.
struct Unrest {
  std::vector<double> sum;  // of squares, of each surfel
  std::vector<int> count;   // of pictures

  // Adds one picture (H×W×3, with alpha and Σ w z of H×W) on the CPU. main: as it stands at the view's time.
  // What lies behind something, and what is beside a mask, is left out.
  void look(const Surfels& main, const View& view, const ViewImages& images, const Tensor<float>& colour,
            const Tensor<float>& alpha, const Tensor<float>& depth);
};
// Marks the surfels that stand still: those whose pictures are no farther off than three times the median or
// 0.1, and those of whose 16 nearest neighbours fewer than ten move. Returns their number. On the CPU.
int64_t mark_still(const Unrest& unrest, Surfels& surfels);

}  // namespace traceflow
