#pragma once

#include <optional>
#include <string>

#include "capture/capture.h"
#include "files/safetensors.h"
#include "train/memory.h"
#include "train/options.h"

// What a resumed run must have in common with the run at its start to end with the same bytes. It is written
// into the checkpoint's metadata and compared on resuming. Older checkpoints that lack it are accepted.
namespace traceflow {

// The options that a checkpoint was written with. where: the name of the checkpoint in error messages.
TrainOptions options_in(const Safetensors& checkpoint, const std::string& where = "checkpoint");

// Throws InputError when a setting differs that the checkpoint's content already fixes: how the scene started
// and what its fields are. A new value would have no effect.
void refuse_reshaping(const TrainOptions& before, const TrainOptions& now);
// Throws InputError when any option of the preset differs from that of the run.
void refuse_other_preset(const std::string& name, const TrainOptions& of_preset, const TrainOptions& now);

// A checksum of the training views' names, times and poses.
std::string checksum_of_views(const Capture& capture);
void put_views(const std::string& checksum, Safetensors& checkpoint);
// The checksum of the training views in a checkpoint; empty in older ones.
std::string views_in(const Safetensors& checkpoint);
// Whether the views are those of the capture, for a scene with this normalisation. Compares names, times and
// poses, not pixels.
bool are_views_of(const std::string& views, const SceneNormalisation& normalisation, const Capture& capture);
// Throws InputError when the capture is not the one that the run began with. normalisation: that of the run's
// scene.
void check_views(const Safetensors& checkpoint, const SceneNormalisation& normalisation,
                 const Capture& capture);

void put_found_masks(const Capture& capture, Safetensors& checkpoint);
// Throws InputError when the capture does not have as many found masks, of this folder, as the run had.
void check_found_masks(const Safetensors& checkpoint, const Capture& capture,
                       const std::filesystem::path& folder);

void put_caps(const SurfelCaps& caps, Safetensors& checkpoint);
// The caps that the run had at its start, unless the caps or the memory budget in the options have changed.
std::optional<SurfelCaps> caps_to_keep(const Safetensors& checkpoint, const TrainOptions& now);

// The device and instructions that compute the numbers. A difference changes the resulting bytes.
void put_arithmetic(Device device, Safetensors& checkpoint);
// The warning if they differ from the checkpoint's; else empty.
std::string other_arithmetic(const Safetensors& checkpoint, Device device);

// The version of the program that computed the numbers, likewise.
void put_version(Safetensors& checkpoint);
std::string other_version(const Safetensors& checkpoint);

}  // namespace traceflow
