#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string_view>
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

// Reads a .ply of 2DGS or 3DGS, or an .spz, by its first bytes. If a .ply's header names an environment's
// file beside it (`traceflow export` writes such pairs), that is read too; `environment`, if not empty, is
// read instead. Throws InputError.
Subject read_splat_subject(const std::filesystem::path& path, const std::filesystem::path& environment);

// The extent of a scene that does not store one: the median distance of its surfels from the mean of the
// cameras. The near plane is relative to it (method §3.4).
float extent_seen_from(const Surfels& surfels, const std::vector<Shot>& shots);

// The files of other programs that surfels are written to (splat/).
enum class SplatFormat { surfel_ply, gaussian_ply, spz, sog };
constexpr std::array<std::string_view, 4> enum_names(SplatFormat) { return {"2dgs", "3dgs", "spz", "sog"}; }

// A copy of the main surfels as stored, posed at `time` (method §1.3) in scene units. Surfels that are not
// finite are left out. Without a time, they are not deformed.
Surfels posed_main(const Subject& subject, std::optional<float> time);

// Writes `surfels` (posed_main at `time`), converted to the capture's coordinates, as main.ply, main.spz or
// main.sog into `folder`. surfel_ply also writes the environment's surfels, as environment.ply, and header
// comments let read_splat_subject reproduce the pictures. name_suffix goes before the extensions, for files
// of several times. Returns the written files.
std::vector<std::filesystem::path> write_subject(const Subject& subject, std::optional<float> time,
                                                 Surfels surfels, const std::filesystem::path& folder,
                                                 SplatFormat format = SplatFormat::surfel_ply,
                                                 const std::string& name_suffix = "");
inline std::vector<std::filesystem::path> export_subject(const Subject& subject, std::optional<float> time,
                                                         const std::filesystem::path& folder) {
  return write_subject(subject, time, posed_main(subject, time), folder);
}

}  // namespace traceflow::viz
