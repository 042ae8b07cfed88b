#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "record/log_history.h"

namespace traceflow {

// Follows the log of a run that another process may be training. Reads only what has been added.
class LogTail {
 public:
  explicit LogTail(std::filesystem::path log) : path_(std::move(log)) {}

  struct News {
    bool anew = false;  // `events` are all valid ones (read_log) and replace the earlier ones
    std::vector<LoggedEvent> events;
  };
  // The whole lines written since the last call. An incomplete last line is left for the next call. All
  // events are returned anew at the first call, if the file has become shorter or has been replaced, and if a
  // resumed session invalidates events returned before. Returns nothing if there is no file, and beyond the
  // limit of LogExtent.
  News next();

 private:
  // The last bytes that were read, as they are in the file now.
  std::string end_of_read(std::istream& file) const;

  std::filesystem::path path_;
  bool begun_ = false;
  LogExtent read_;
  std::string last_read_;  // the last bytes that were read
  int64_t iteration_ = 0;  // of the last "step" or "started" event
};

}  // namespace traceflow
