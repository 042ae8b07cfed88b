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

RunWatch::RunWatch(RunFolder run) : run_(std::move(run)) { look(); }

RunWatch::Change RunWatch::look() {
  Change change;
  const Version checkpoint = version_of(run_.checkpoint());
  // While a checkpoint is renamed to the one before, only that one is there.
  change.vanished = checkpoint.size < 0 && version_of(run_.previous_checkpoint()).size < 0;
  change.returned = gone_ && !change.vanished;
  gone_ = change.vanished;
  change.saved = checkpoint.size >= 0 && checkpoint != checkpoint_;
  if (checkpoint.size >= 0) checkpoint_ = checkpoint;
  const Version log = version_of(run_.log());
  change.logged = log.size >= 0 && log != log_;
  if (log.size >= 0) log_ = log;
  return change;
}

}  // namespace traceflow::serve
