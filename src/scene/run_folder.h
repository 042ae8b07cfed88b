#pragma once

#include <filesystem>
#include <string>

#include "files/safetensors.h"

namespace traceflow {

// Where a training run keeps its files.
struct RunFolder {
  std::filesystem::path folder;

  std::filesystem::path checkpoint() const { return folder / "checkpoint.safetensors"; }
  std::filesystem::path previous_checkpoint() const { return folder / "checkpoint.previous.safetensors"; }
  // One that a resumed training found damaged, kept for whoever wants to know why.
  std::filesystem::path damaged_checkpoint() const { return folder / "checkpoint.damaged.safetensors"; }
  std::filesystem::path log() const { return folder / "log.jsonl"; }
  // Of what moves, where training found them.
  std::filesystem::path masks() const { return folder / "masks"; }
  std::filesystem::path lock() const { return folder / "lock"; }

  // Throws InputError where the system does not say.
  bool holds_a_run() const;
};

// Of what write_checkpoint writes. 1 had no checksums.
inline constexpr int checkpoint_version = 2;

// The newest checkpoint that can be read: the current one, or the previous one when the current one is
// missing or damaged; then `note` says so in a line, with the section that is damaged. Throws InputError when
// there is none, when the current one cannot be read, and for one of a newer version.
Safetensors read_checkpoint(const RunFolder& run, std::string& note);

// What becomes of the current checkpoint when another takes its place.
enum class Current { becomes_previous, is_dropped };

// Writes a checkpoint, with its version, and keeps the one before it, or the one before that. At every moment
// a whole one stands, the current one wherever a file may have two names. Makes the folder where there is
// none. Throws InputError when the disk refuses; then those before stand.
void write_checkpoint(const RunFolder& run, Safetensors file, Current current = Current::becomes_previous);

// Puts the current checkpoint, which is damaged, where it does not take the place of the one before it.
void set_damaged_aside(const RunFolder& run);

}  // namespace traceflow
