#include "render/render_options.h"

#include <algorithm>

namespace traceflow {

void TracksOptions::validate() const {
  check_option(frames >= 1 && frames <= 1000, "render.tracks_frames", frames, "1 to 1000");
  check_option(most >= 1 && most <= 2000, "render.tracks_most", most, "1 to 2000");
  check_option(least_move >= 0 && least_move <= 1, "render.tracks_least_move", least_move, "0 to 1");
}

void RenderOptions::validate() const {
  check_option(depth_ratio >= 0 && depth_ratio <= 1, "render.depth_ratio", depth_ratio, "0 to 1");
  check_option(samples >= 1 && samples <= 4, "render.samples", samples, "1 to 4");
  check_option(trace_alpha_min > 0 && trace_alpha_min < alpha_max, "render.trace_alpha_min", trace_alpha_min,
               "more than 0 and less than render.alpha_max");
  select.validate();
  tracks.validate();
  raster_options(1).validate();
  trace_options(1).validate();
}

raster::Options RenderOptions::raster_options(float extent) const {
  raster::Options options;
  options.sort = sort;
  options.near_plane = near_plane * extent;
  options.far_plane = far_plane * extent;
  options.low_pass = low_pass ? 1 : 0;
  options.alpha_min = alpha_min;
  options.alpha_max = alpha_max;
  options.transmittance_min = std::max(transmittance_min, raster::least_transmittance);
  options.background = background;
  return options;
}

trace::Options RenderOptions::trace_options(float extent) const {
  trace::Options options;
  options.t_min = trace_from * extent;
  options.alpha_min = trace_alpha_min;
  options.alpha_max = alpha_max;
  options.transmittance_min = transmittance_min;
  options.hits_per_pass = hits_per_pass;
  options.background = specular_background;
  return options;
}

}  // namespace traceflow
