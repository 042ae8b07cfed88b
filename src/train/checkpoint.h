#pragma once

#include "files/safetensors.h"
#include "train/training_state.h"

// The training state in a checkpoint. What else a checkpoint holds, about the run: train/continuation.h.
namespace traceflow {

void put_state(const TrainingState& state, Safetensors& file);

// Reads a state. scene: that of the checkpoint, on the run's device. cloud_radius: the environment's radius
// in checkpoints that do not have it. Throws InputError when the checkpoint does not fit the capture or is
// not valid.
TrainingState get_state(const Safetensors& file, Scene scene, const TrainOptions& options,
                        const Capture& capture, float cloud_radius);

}  // namespace traceflow
