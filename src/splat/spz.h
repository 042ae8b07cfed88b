#pragma once

#include <filesystem>

#include "scene/surfels.h"

// Niantic's .spz, a compressed file of 3D Gaussians (github.com/nianticlabs/spz, versions 2 to 4).
namespace traceflow {

// Writes version 3, which is one gzip stream, atomically: positions of 24 bits, with as many fractional bits
// as the farthest surfel leaves; log-scales in steps of 1/16, from −10 to 5.9, the third of each as
// log_thickness has it; rotations of 32 bits; opacities, colours and harmonics of 8 bits, where harmonics
// above degree 0 are clamped to [−1, 1). Tint and roughness are left out. Coordinates are written as they
// are, without a change of axes, as other programs that convert .ply do.
void write_spz(const std::filesystem::path& path, const Surfels& surfels);

// Whether a file begins like an .spz and not like a .ply. Throws InputError if it cannot be read.
bool is_spz(const std::filesystem::path& path);

// Reads versions 2 and 3 (gzip) and 4 (Zstandard), harmonics of degree 0 to 3, as surfels (flatten). Ignores
// extensions. Throws InputError for anything else, and for more Gaussians than the file can hold.
Surfels read_spz(const std::filesystem::path& path);

}  // namespace traceflow
