#pragma once

#include <filesystem>
#include <string>

#include "files/safetensors.h"

namespace traceflow {

// Paths of a training run's files.
struct RunFolder {
  std::filesystem::path folder;

  std::filesystem::path checkpoint() const { return folder / "checkpoint.safetensors"; }
  std::filesystem::path previous_checkpoint() const { return folder / "checkpoint.previous.safetensors"; }
  // A checkpoint that a resumed training found damaged, kept for inspection.
  std::filesystem::path damaged_checkpoint() const { return folder / "checkpoint.damaged.safetensors"; }
  std::filesystem::path log() const { return folder / "log.jsonl"; }
  // Masks of moving things, if training computed them.
  std::filesystem::path masks() const { return folder / "masks"; }
  std::filesystem::path lock() const { return folder / "lock"; }

  // Throws InputError if the system cannot tell.
  bool holds_a_run() const;
};

// Version of the files of write_checkpoint. Version 1 had no checksums.
inline constexpr int checkpoint_version = 2;

// Reads the newest usable checkpoint: the current one, or the previous one if the current one is missing or
// damaged; then `note` explains this in one line, with the damaged section. Throws InputError if there is
// none, if the current one cannot be read, and for one of a newer version.
Safetensors read_checkpoint(const RunFolder& run, std::string& note);

// What happens to the current checkpoint when a new one replaces it.
enum class Current { becomes_previous, is_dropped };

// Writes a checkpoint with its version, and keeps the one before it, or the one before that. At every moment
// there is a whole checkpoint, under the current name if the file system has hard links. Creates the folder
// if it is missing. Throws InputError if writing fails; then the old checkpoints remain.
void write_checkpoint(const RunFolder& run, Safetensors file, Current current = Current::becomes_previous);

// Renames the current checkpoint, which is damaged, so that it does not replace the previous one.
void set_damaged_aside(const RunFolder& run);

}  // namespace traceflow
