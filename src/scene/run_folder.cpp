#include "scene/run_folder.h"

#include <system_error>

#include "base/error.h"

namespace traceflow {

Safetensors read_checkpoint(const RunFolder& run, std::string& note) {
  namespace fs = std::filesystem;
  if (!fs::exists(run.checkpoint()) && !fs::exists(run.previous_checkpoint())) {
    throw InputError(run.folder.string(), "checkpoint.safetensors", "no such file",
                     "a folder that traceflow train wrote");
  }
  try {
    return Safetensors::read(run.checkpoint());
  } catch (const InputError& error) {
    if (!fs::exists(run.previous_checkpoint())) throw;
    note = std::string(error.what()) + "; using the checkpoint before it";
    return Safetensors::read(run.previous_checkpoint());
  }
}

void write_checkpoint(const RunFolder& run, const Safetensors& file) {
  // Write the new one beside the old before either changes its name, so that at every moment a whole one
  // stands.
  const std::filesystem::path fresh = run.folder / "checkpoint.new.safetensors";
  file.write(fresh);
  std::error_code error;
  if (std::filesystem::exists(run.checkpoint())) {
    std::filesystem::rename(run.checkpoint(), run.previous_checkpoint(), error);
  }
  if (!error) std::filesystem::rename(fresh, run.checkpoint(), error);
  if (error) throw InputError(run.checkpoint().string(), "rename", error.message(), "a writable folder");
}

}  // namespace traceflow
