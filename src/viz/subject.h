#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "render/renderer.h"
#include "scene/scene.h"
#include "viz/cameras/shot.h"

namespace traceflow::viz {

// What pictures are made of: a scene with all that its pictures depend on beside camera and time.
struct Subject {
  Scene scene;
  RenderOptions render;
  FrameRequest request;  // which parts of the scene take part; camera and time are each shot's own
  std::string warning;   // one line on what a picture will lack; empty when all is there
};

// Reads a .ply and, where its notes name one, the environment's .ply beside it (`traceflow export` writes
// such pairs); `environment`, when not empty, is read in its place. Throws InputError.
Subject read_ply_subject(const std::filesystem::path& path, const std::filesystem::path& environment);

// A scene's size for one that does not tell: the median distance of its surfels from the middle of the
// cameras. The near plane is relative to it (method §3.4).
float extent_seen_from(const Surfels& surfels, const std::vector<Shot>& shots);

// Main and environment surfels posed at `time` (method §1.3) and taken to the capture's own coordinates, as
// main.ply and environment.ply in `folder`, with notes that let read_ply_subject make the same pictures.
// Without a time they stay as they are stored, undeformed. Returns the files written.
std::vector<std::filesystem::path> export_subject(const Subject& subject, std::optional<float> time,
                                                  const std::filesystem::path& folder);

}  // namespace traceflow::viz
