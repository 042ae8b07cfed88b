#pragma once

#include <optional>
#include <vector>

#include "capture/capture.h"
#include "scene/motion.h"
#include "scene/nodes.h"
#include "scene/surfels.h"

// To one camera a body that is larger and farther away looks the same. The first key's poses keep the
// distance that the points tell (track/tracker.h); all other keys may come to agree on another size.
namespace traceflow {

// The position of the camera at each key of a motion; nothing where a key has no view or several, which tell
// the distance themselves.
std::optional<std::vector<Vec3<double>>> positions_of_single_cameras(const Capture& capture,
                                                                     const Motion& motion);

// Divides by ratio[b] the size of rigid body b, about its centre, and at all keys from `first` on its
// distance from the camera: there the camera sees the same as before. eyes: of each key, scene units. On the
// CPU.
void rescale_bodies(const std::vector<double>& ratio, const std::vector<Vec3<double>>& eyes, int64_t first,
                    Surfels& main, Motion& motion);

// The ratios of bodies that move at least three times as much as rescaling them from the first key on would
// add; 1 for others. What hardly moves tells its distance by parallax. eyes: of each key, scene units.
std::vector<double> ratios_of_what_moves(std::vector<double> ratio, const std::vector<Vec3<double>>& eyes,
                                         const Motion& motion);

// So a bent body that grows looks like one that comes closer. Of all sizes at each time of its nodes, up to
// 15 % more or less than it has, those at which the most of the body is where it was at first: where its foot
// stands, it grows. Minimises over g_k, ratios being 1 + g_k,
//   Σ_k mean_n d²/(1 + d²) + 10 g_k² + 30 (g_k − g_{k−1})²,
// d being how far node n is from where it was at first, in halves of its radius. By dynamic programming over
// steps of 0.25 %; g_0 = 0. eyes: of each key, scene units. On the CPU.
std::vector<double> standing_ratios(const std::vector<Vec3<double>>& eyes, const Motion& motion,
                                    const Nodes& nodes, int32_t body);
// Multiplies by ratios, one a time of the nodes, linear in between, how far apart the body's nodes are and
// its distance from the camera: that sees its nodes where it did.
void rescale_bent_body(const std::vector<double>& ratios, const std::vector<Vec3<double>>& eyes, int32_t body,
                       Motion& motion, Nodes& nodes);

}  // namespace traceflow
