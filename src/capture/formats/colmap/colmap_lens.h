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

// Null for models that COLMAP does not have.
const ColmapLensModel* find_colmap_lens_model(int id);
const ColmapLensModel* find_colmap_lens_model(std::string_view name);

// where, field: location of the camera in the files, for errors. Throws InputError for models that Lens
// cannot represent and for invalid parameters.
Lens colmap_lens(const ColmapLensModel& model, std::span<const double> parameters, double width,
                 double height, const std::string& where, const std::string& field);

}  // namespace traceflow
