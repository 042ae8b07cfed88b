#include "scene/run_folder.h"

#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "files/input_file.h"

namespace traceflow {

namespace {

namespace fs = std::filesystem;

bool stands(const fs::path& path) {
  std::error_code error;
  const bool found = fs::exists(path, error);
  if (error) throw UnreadableFile(path, error.message());
  return found;
}

// Reads a checkpoint and verifies its checksums, which are required from version 2 on.
Safetensors read_sound(const fs::path& path) {
  Safetensors file = Safetensors::read(path);
  if (file.number("version") > 1 && !file.has_checksums()) {
    throw InputError(path.string(), "metadata", "no checksums", "one for each section",
                     "the file is damaged");
  }
  return file;
}

void check_version(const Safetensors& file, const RunFolder& run) {
  if (file.number("version") <= checkpoint_version) return;
  throw InputError(run.folder.string(), "checkpoint version", file.text("version"),
                   "at most " + std::to_string(checkpoint_version),
                   "a newer traceflow wrote it: use that one");
}

std::string iteration_of(const Safetensors& file) {
  const auto found = file.metadata.find("iteration");
  return found == file.metadata.end() ? "" : ", of iteration " + found->second;
}

// The current checkpoint, or the previous one and the reason. A checkpoint that cannot be read at the moment
// may be intact, so it is no reason to fall back.
Safetensors newest_sound(const RunFolder& run, std::string& note) {
  std::string problem;
  try {
    return read_sound(run.checkpoint());
  } catch (const UnreadableFile&) {
    throw;
  } catch (const InputError& error) {
    problem = error.what();
  }
  if (!stands(run.previous_checkpoint())) {
    throw InputError(problem, "", "", "", "there is no checkpoint before it to go back to");
  }
  try {
    Safetensors before = read_sound(run.previous_checkpoint());
    note = problem + "; using the checkpoint before it" + iteration_of(before);
    return before;
  } catch (const InputError& error) {
    throw InputError(problem, "", "", "", std::string("nor can the one before it be used: ") + error.what());
  }
}

// Gives the current checkpoint the name of the previous one as a second name (a hard link), so that it keeps
// its own until the new one takes it. On file systems without hard links, it loses its own.
void name_previous(const RunFolder& run, std::error_code& error) {
  const fs::path second = run.folder / "checkpoint.previous.safetensors.link";
  std::error_code refused;
  fs::remove(second, refused);
  fs::create_hard_link(run.checkpoint(), second, refused);
  fs::rename(refused ? run.checkpoint() : second, run.previous_checkpoint(), error);
  // If the previous checkpoint is already this file, rename does nothing and the link remains.
  fs::remove(second, refused);
}

}  // namespace

bool RunFolder::holds_a_run() const { return stands(checkpoint()) || stands(previous_checkpoint()); }

Safetensors read_checkpoint(const RunFolder& run, std::string& note) {
  if (!run.holds_a_run()) {
    throw InputError(run.folder.string(), "checkpoint.safetensors", "no such file",
                     "a folder that traceflow train wrote");
  }
  Safetensors file = newest_sound(run, note);
  check_version(file, run);
  return file;
}

void write_checkpoint(const RunFolder& run, Safetensors file, Current current) {
  file.metadata["version"] = std::to_string(checkpoint_version);
  std::error_code error;
  make_folder(run.folder);
  // The new file is complete before either old one changes its name, so that there is a whole checkpoint at
  // every moment.
  const fs::path fresh = run.folder / "checkpoint.new.safetensors";
  file.write(fresh);
  if (current == Current::becomes_previous && stands(run.checkpoint())) name_previous(run, error);
  if (!error) fs::rename(fresh, run.checkpoint(), error);
  if (error) throw InputError(run.checkpoint().string(), "rename", error.message(), "a writable folder");
  sync_folder(run.folder);
}

void set_damaged_aside(const RunFolder& run) {
  std::error_code error;
  if (stands(run.checkpoint())) fs::rename(run.checkpoint(), run.damaged_checkpoint(), error);
  if (error) throw InputError(run.checkpoint().string(), "rename", error.message(), "a writable folder");
}

}  // namespace traceflow
