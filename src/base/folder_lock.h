#pragma once

#include <filesystem>
#include <string>

#include "base/descriptor.h"

namespace traceflow {

// Keeps other programs from working in a folder while this object exists. Readers need no lock. The system
// releases the lock when the program ends, however it ends; if it is killed, when the programs that it
// started have ended too.
class FolderLock {
 public:
  // file: the lock file, in an existing folder: this one or its parent. work: the activity, such as
  // "training", for the message to other programs. Throws InputError with the folder and the holder if
  // another process holds the lock, and if the file cannot be written.
  FolderLock(const std::filesystem::path& file, const std::filesystem::path& folder, const std::string& work);
  ~FolderLock();
  // False if the file system has no locks, so that nothing keeps others out.
  bool keeps_others_out() const { return keeps_others_out_; }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  std::filesystem::path file_;
  Descriptor lock_;
  bool keeps_others_out_ = true;
};

}  // namespace traceflow
