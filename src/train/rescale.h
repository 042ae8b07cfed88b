#pragma once

#include <optional>
#include <vector>

#include "capture/capture.h"
#include "scene/motion.h"
#include "scene/surfels.h"

// To one camera a body that is larger and farther away looks the same. The first key's poses keep the
// distance that the points tell (train/tracker.h); all other keys may come to agree on another size.
namespace traceflow {

// The position of the camera at each key of a motion; nothing where a key has no view or several, which tell
// the distance themselves.
std::optional<std::vector<Vec3<double>>> positions_of_single_cameras(const Capture& capture,
                                                                     const Motion& motion);

// Divides by ratio[b] the size of rigid body b, about its centre, and at all keys but the first its distance
// from the camera: there the camera sees the same as before. eyes: of each key, scene units. On the CPU.
void rescale_bodies(const std::vector<double>& ratio, const std::vector<Vec3<double>>& eyes, Surfels& main,
                    Motion& motion);

}  // namespace traceflow
