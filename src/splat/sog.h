#pragma once

#include <filesystem>

#include "scene/surfels.h"

namespace traceflow {

// Writes 3D Gaussians as PlayCanvas' SOG, version 2 (developer.playcanvas.com, "The SOG Format"): one zip
// archive of lossless WebP images and meta.json, atomically. Positions have 16 bits on a logarithmic scale;
// rotations 26 bits; opacities 8 bits; log-scales and colours are entries of a codebook of 256, the third
// scale as log_thickness has it; harmonics above degree 0 are rows of a palette of at most 65,536. Gaussians
// are in Morton order. Numbers that are not finite become something finite. Tint and roughness are left out.
// Throws InputError for no surfels or more than 16,380², which do not fit.
void write_sog(const std::filesystem::path& path, const Surfels& surfels);

}  // namespace traceflow
