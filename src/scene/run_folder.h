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
  std::filesystem::path log() const { return folder / "log.jsonl"; }
};

// The newest checkpoint that can be read: the current one, or the previous one when the current one is
// missing or damaged; then `note` says so in a line. Throws InputError when there is none.
Safetensors read_checkpoint(const RunFolder& run, std::string& note);

// Writes a checkpoint (atomically) and keeps the one before it.
void write_checkpoint(const RunFolder& run, const Safetensors& file);

}  // namespace traceflow
