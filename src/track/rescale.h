#pragma once

#include <optional>
#include <vector>

#include "capture/capture.h"
#include "scene/motion.h"
#include "scene/nodes.h"
#include "scene/surfels.h"

// To a single camera, a larger body farther away looks the same. The poses of the first key keep the distance
// of the points (track/tracker.h); the other keys may agree on another size.
namespace traceflow {

// The position of the camera at each key of a motion. Returns nothing if a key has no view, or several views,
// which determine the distance themselves.
std::optional<std::vector<Vec3<double>>> positions_of_single_cameras(const Capture& capture,
                                                                     const Motion& motion);

// Divides by ratio[b] the size of rigid body b about its centre and, at all keys from `first` on, its
// distance from the camera. There its image stays the same. eyes: per key, scene units. On the CPU.
void rescale_bodies(const std::vector<double>& ratio, const std::vector<Vec3<double>>& eyes, int64_t first,
                    Surfels& main, Motion& motion);

// The ratios of bodies that move at least three times as much as rescaling from the first key on would add; 1
// for others. If a body hardly moves, parallax determines its distance. eyes: per key, scene units.
std::vector<double> ratios_of_what_moves(std::vector<double> ratio, const std::vector<Vec3<double>>& eyes,
                                         const Motion& motion);

// Likewise, a deforming body that grows looks like one that approaches. These ratios of sizes, one at each
// time of the nodes and within 15 % of the present size, keep as much of the body as possible where it
// started. For example, a body with a fixed foot grows instead of approaching. They minimise over g_k, with
// ratios 1 + g_k,
//   Σ_k mean_n d²/(1 + d²) + 10 g_k² + 30 (g_k − g_{k−1})²,
// where d is the distance of node n from its first position, in halves of its radius. By dynamic programming
// in steps of 0.25 %; g_0 = 0. eyes: per key, scene units. On the CPU.
std::vector<double> standing_ratios(const std::vector<Vec3<double>>& eyes, const Motion& motion,
                                    const Nodes& nodes, int32_t body);
// Multiplies the distances between the body's nodes and its distance from the camera by the ratios, one per
// time of the nodes, linear in between. The camera sees the nodes in the same places.
void rescale_bent_body(const std::vector<double>& ratios, const std::vector<Vec3<double>>& eyes, int32_t body,
                       Motion& motion, Nodes& nodes);

}  // namespace traceflow
