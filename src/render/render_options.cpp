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
  check_option(trace.alpha_min > 0 && trace.alpha_min < raster.alpha_max, "render.trace_alpha_min",
               trace.alpha_min, "more than 0 and less than render.alpha_max");
  select.validate();
  tracks.validate();
  raster_options(1).validate();
  trace_options(1).validate();
}

raster::Options RenderOptions::raster_options(float extent) const {
  raster::Options options = raster;
  options.near_plane *= extent;
  options.far_plane *= extent;
  options.low_pass = low_pass ? 1 : 0;
  options.transmittance_min = std::max(raster.transmittance_min, raster::least_transmittance);
  return options;
}

trace::Options RenderOptions::trace_options(float extent) const {
  trace::Options options = trace;
  options.t_min *= extent;
  options.alpha_max = raster.alpha_max;
  options.transmittance_min = raster.transmittance_min;
  return options;
}

}  // namespace traceflow
