#pragma once

#include "capture/synth/synth.h"

namespace traceflow::prepare {

// Five training and two test views of 80×48: enough points for normals and depths to be compared with them.
inline SynthOptions small_capture() {
  SynthOptions options;
  options.frames = 5;
  options.width = 80;
  options.height = 48;
  options.samples = 1;
  options.points = 4000;
  options.test_every = 2;
  return options;
}

}  // namespace traceflow::prepare
