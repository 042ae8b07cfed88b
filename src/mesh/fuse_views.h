#pragma once

#include <functional>
#include <vector>

#include "mesh/fusion.h"
#include "viz/subject.h"

namespace traceflow::mesh {

// A rendered frame as a view in the scene's units, on the host: its final colours, its normals and alpha, and
// the surface's depth as depth_ratio blends it of expected and median depth (method §4.1).
DepthView depth_view(const Frame& frame, float depth_ratio);

// Called after each rendered view with the number of those that are done, and of all.
using FuseProgress = std::function<void(size_t done, size_t all)>;

// The surface of a subject at a time: renders it from the shots' cameras, in order, and fuses the views. The
// shots' own times do not matter. The mesh is in the capture's coordinates, and so are the lengths in
// `options`. If options.voxel is 0, the views are first rendered at an eighth of their size to find the box
// around what they show, without the farthest hundredth at each side; these count in the progress. Throws
// InputError for invalid options, or if the views show no surface. There must be a shot.
TriangleMesh fuse_views(const viz::Subject& subject, const std::vector<viz::Shot>& shots, float time,
                        const FusionOptions& options, const FuseProgress& progress = {});

}  // namespace traceflow::mesh
