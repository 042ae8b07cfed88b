#include "ops/raster/raster.h"

#include <cmath>

namespace traceflow::raster {

void Options::validate() const {
  check_option(std::isfinite(near_plane) && near_plane > 0, "near_plane", near_plane, "a length above 0");
  check_option(std::isfinite(far_plane) && far_plane > near_plane, "far_plane", far_plane,
               "a length above near_plane");
  check_option(alpha_min >= 1e-6F && alpha_min < 1, "alpha_min", alpha_min, "1e-6 or more, and under 1");
  check_option(alpha_max > alpha_min && alpha_max < 1, "alpha_max", alpha_max, "between alpha_min and 1");
  check_option(transmittance_min >= 0 && transmittance_min < 1, "transmittance_min", transmittance_min,
               "0 or more, and under 1");
  for (int c = 0; c < 3; ++c) {
    check_option(std::isfinite(background[c]), "background", background[c], "finite numbers");
  }
}

}  // namespace traceflow::raster
