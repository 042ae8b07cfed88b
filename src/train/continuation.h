#pragma once

#include <optional>
#include <string>

#include "capture/capture.h"
#include "files/safetensors.h"
#include "train/memory.h"
#include "train/options.h"

// What a run that goes on must have in common with the run as it began, so that it ends in the same bytes:
// written into the checkpoint's metadata, and compared when it is resumed. Checkpoints from before these were
// written are taken as they are.
namespace traceflow {

// The options that a checkpoint was written with. where: what refusals name it.
TrainOptions options_in(const Safetensors& checkpoint, const std::string& where = "checkpoint");

// Throws InputError for a setting that is part of what the checkpoint holds already, so that another value
// would do nothing: what the scene started from and what its fields are.
void refuse_reshaping(const TrainOptions& before, const TrainOptions& now);
// Throws InputError where a preset has another value, of whatever option, than the run has.
void refuse_other_preset(const std::string& name, const TrainOptions& of_preset, const TrainOptions& now);

// Of the training views' names, times and poses.
std::string checksum_of_views(const Capture& capture);
void put_views(const std::string& checksum, Safetensors& checkpoint);
// What a checkpoint says of the views that it was trained on; nothing in older ones.
std::string views_in(const Safetensors& checkpoint);
// Whether they are the capture's, for a scene that is normalised so: by the views' names, times and poses,
// not by their pixels.
bool are_views_of(const std::string& views, const SceneNormalisation& normalisation, const Capture& capture);
// Throws InputError where the capture is not the one that the run, whose scene is normalised so, was begun
// with.
void check_views(const Safetensors& checkpoint, const SceneNormalisation& normalisation,
                 const Capture& capture);

void put_caps(const SurfelCaps& caps, Safetensors& checkpoint);
// Those that the run was dealt when it began, unless it is told to take other sizes or another budget now.
std::optional<SurfelCaps> caps_to_keep(const Safetensors& checkpoint, const TrainOptions& now);

// On what numbers are computed: other bytes come of it where it differs.
void put_arithmetic(Device device, Safetensors& checkpoint);
// What is to be said where it is another than the checkpoint's; else nothing.
std::string other_arithmetic(const Safetensors& checkpoint, Device device);

// Which program computed them. As above.
void put_version(Safetensors& checkpoint);
std::string other_version(const Safetensors& checkpoint);

}  // namespace traceflow
