#pragma once

#include <filesystem>
#include <string>

#include "base/descriptor.h"

namespace traceflow {

// Keeps a second program out of a folder's work for as long as this stands. Readers are free. The system lets
// go of it when the program ends, however it ends; where it is killed, when what it has started has ended
// too.
class FolderLock {
 public:
  // file: the lock, in the folder or beside it, in a folder that is there. work: what is being done, as in
  // "training", for who is kept out. Throws InputError, naming the folder and who holds it, when another
  // process does, and when the file cannot be written.
  FolderLock(const std::filesystem::path& file, const std::filesystem::path& folder, const std::string& work);
  ~FolderLock();
  // False where the file system knows no locks, so that nobody is kept out.
  bool keeps_others_out() const { return keeps_others_out_; }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  std::filesystem::path file_;
  Descriptor lock_;
  bool keeps_others_out_ = true;
};

}  // namespace traceflow
