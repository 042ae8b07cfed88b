#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "record/log_history.h"

namespace traceflow {

// Follows the log of a run that another process may be training: what was read once is not read again.
class LogTail {
 public:
  explicit LogTail(std::filesystem::path log) : path_(std::move(log)) {}

  struct News {
    bool anew = false;  // `events` are all that count (read_log) and replace what was told before
    std::vector<LoggedEvent> events;
  };
  // What has been written since the last time, in whole lines: a line without its end is left for later.
  // Anew the first time, when the file has become shorter or is another one, and when a resumed session takes
  // back what was told. Nothing while there is no file, and beyond the LogExtent that is all.
  News next();

 private:
  // The end of what was read, as it stands there now.
  std::string end_of_read(std::istream& file) const;

  std::filesystem::path path_;
  bool begun_ = false;
  LogExtent read_;
  std::string last_read_;  // the end of it
  int64_t iteration_ = 0;  // of the last step or start
};

}  // namespace traceflow
