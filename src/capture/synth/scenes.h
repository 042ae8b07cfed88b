#pragma once

#include "capture/synth/scene.h"
#include "capture/synth/synth.h"

namespace traceflow::synth {

// The named scenes: a closed room of 3.4 × 3.4 × 2.3 m around the origin with moving objects in its middle.
AnimatedScene make_scene(SynthScene scene);

// A textured box and a mirroring kettle, held in the air, that rotate by about 90° and come nearer.
AnimatedScene tumble();
// A textured pillar on the floor that bends and stretches.
AnimatedScene soft();

}  // namespace traceflow::synth
