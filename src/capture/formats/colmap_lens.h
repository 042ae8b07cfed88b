#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "capture/lens/lens.h"

namespace traceflow {

// A camera model of COLMAP.
struct ColmapLensModel {
  int id;  // in binary files
  std::string_view name;
  size_t parameters;
};

// Null for what COLMAP does not know.
const ColmapLensModel* find_colmap_lens_model(int id);
const ColmapLensModel* find_colmap_lens_model(std::string_view name);

// where, field: of the camera, for errors. Throws InputError for a model that no Lens can be, and for
// parameters that make no camera.
Lens colmap_lens(const ColmapLensModel& model, std::span<const double> parameters, double width,
                 double height, const std::string& where, const std::string& field);

}  // namespace traceflow
