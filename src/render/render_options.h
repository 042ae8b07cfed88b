#pragma once

#include "base/options.h"
#include "math/types.h"
#include "ops/field/field.h"
#include "ops/raster/raster.h"
#include "ops/surface/surface.h"
#include "ops/trace/trace.h"

namespace traceflow {

// The points that the layer `tracks` follows, and the length of their paths.
struct TracksOptions {
  int frames = 12;           // length, in times of the capture
  int most = 400;            // number of points
  float least_move = 0.01F;  // in extents

  void validate() const;
};

// How a frame is rendered from a scene. Lengths, those of `raster` and `trace` too, are relative to the
// scene's extent, so that values fit every capture; raster_options() and trace_options() give them in scene
// units.
struct RenderOptions {
  raster::Options raster;  // low_pass is set by the field below
  bool low_pass = true;
  int samples = 1;
  float depth_ratio = 0;
  trace::Options trace;  // alpha_max and transmittance_min are those of `raster`
  surface::SelectOptions select;
  field::Precision precision = field::Precision::fp32;
  TracksOptions tracks;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("sort", raster.sort, "",
            "Blending order: centre (as 2DGS) or hit (exact per pixel) (method §3.3).");
    v.field("near_plane", raster.near_plane, "extents", "Minimum camera depth that is drawn (method §3.4).");
    v.field("far_plane", raster.far_plane, "extents",
            "Far end of the depth mapping of the distortion (method §3.5).");
    v.field("low_pass", low_pass, "", "Use the screen-space low-pass filter of 2DGS (method §3.2).");
    v.field("samples", samples, "samples", "Number of samples along each side of a pixel (method §3.6).");
    v.field("alpha_min", raster.alpha_min, "", "Hits with a lower opacity are skipped (method §3.3).");
    v.field("alpha_max", raster.alpha_max, "",
            "Maximum opacity of a hit; higher values are clamped (method §3.3).");
    v.field("transmittance_min", raster.transmittance_min, "",
            "A ray ends before its transmittance falls below this.");
    v.field("depth_ratio", depth_ratio, "",
            "Depth of the surface: 0 is the expected depth, 1 the median depth, and values between blend "
            "both (method §4.1).");
    v.field("trace_from", trace.t_min, "extents",
            "Reflected hits nearer than this are ignored (method §5.2).");
    v.field("trace_alpha_min", trace.alpha_min, "",
            "Reflected hits with a lower opacity are skipped (method §5.1).");
    v.field("hits_per_pass", trace.hits_per_pass, "hits",
            "Number of hits that the tracer holds at a time; affects the speed, not the image.");
    v.field("background", raster.background, "", "Colour behind the main surfels (method §3.5).");
    v.field("specular_background", trace.background, "", "Colour behind the environment (method §5.4).");
    v.group("select", select);
    v.field("precision", precision, "", "Arithmetic of the fields' hidden layers: fp32 or bf16.");
    v.field("tracks_frames", tracks.frames, "times",
            "Layer tracks: length of a track, as a number of frames of the capture.");
    v.field("tracks_most", tracks.most, "points", "Layer tracks: maximum number of points with a track.");
    v.field("tracks_least_move", tracks.least_move, "extents",
            "Layer tracks: minimum distance that a point must move within the video to get a track.");
  }
  void validate() const;

  // The options of the ops for a scene of this extent, in its units.
  raster::Options raster_options(float extent) const;
  trace::Options trace_options(float extent) const;
};

}  // namespace traceflow
