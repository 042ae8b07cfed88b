#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "render/renderer.h"
#include "scene/scene.h"
#include "viz/cameras/shot.h"

namespace traceflow::viz {

// All that pictures depend on besides camera and time.
struct Subject {
  Scene scene;
  RenderOptions render;
  FrameRequest request;  // the parts of the scene to render; camera and time are set by each shot
  std::string warning;   // one line on what pictures lack; empty if nothing
};

// Reads a .ply and, if its header names one, the environment's .ply beside it (`traceflow export` writes such
// pairs). `environment`, if not empty, is read instead. Throws InputError.
Subject read_ply_subject(const std::filesystem::path& path, const std::filesystem::path& environment);

// The extent of a scene that does not store one: the median distance of its surfels from the mean of the
// cameras. The near plane is relative to it (method §3.4).
float extent_seen_from(const Surfels& surfels, const std::vector<Shot>& shots);

// Writes main and environment surfels, posed at `time` (method §1.3) and converted to the capture's
// coordinates, as main.ply and environment.ply into `folder`. Header comments let read_ply_subject reproduce
// the pictures. Without a time, surfels are written as stored, without deformation. Returns the written
// files.
std::vector<std::filesystem::path> export_subject(const Subject& subject, std::optional<float> time,
                                                  const std::filesystem::path& folder);

}  // namespace traceflow::viz
