#include "serve/run_watch.h"

namespace traceflow::serve {

RunWatch::Version RunWatch::version_of(const std::filesystem::path& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error) return {};
  const auto changed = std::filesystem::last_write_time(path, error);
  if (error) return {};
  return {static_cast<int64_t>(size), static_cast<int64_t>(changed.time_since_epoch().count())};
}

RunWatch::RunWatch(RunFolder run) : run_(std::move(run)) {
  poll();
  accept();
}

RunWatch::Change RunWatch::poll() {
  const Version checkpoint = version_of(run_.checkpoint());
  if (checkpoint.size < 0) {
    // On file systems without hard links, the checkpoint is renamed to the previous one first. For a moment
    // only that one exists.
    return {version_of(run_.previous_checkpoint()).size < 0, false};
  }
  seen_ = checkpoint;
  return {false, seen_ != read_};
}

}  // namespace traceflow::serve
