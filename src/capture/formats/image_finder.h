#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "files/file_tree.h"

namespace traceflow {

// Finds images as find_image does (capture/formats/image_names.h), where a file may name a million paths:
// each folder of the tree is listed once, and what is not there costs no call of the system. For one thread.
class ImageFinder {
 public:
  // The names in a folder ("" is the top); none where there is no such folder.
  using List = std::function<std::vector<std::string>(const std::string& folder)>;

  // The tree outlives the finder.
  explicit ImageFinder(const FileTree& tree);
  // The same with somebody else's lists. most_names: in all folders that are listed; name: of the tree, for
  // errors.
  ImageFinder(std::string name, List files_in, List folders_in, int64_t most_names);

  // path: as tidy_path makes it. Throws InputError where the folders that were looked into hold more names
  // than are kept: links that lead back make folders without end.
  std::string find(const std::string& path);

 private:
  struct Folder {
    std::set<std::string> files;
    std::map<std::string, std::unique_ptr<Folder>, std::less<>> folders;  // null: not listed yet
  };

  Folder list(const std::string& path);
  // Null where there is none.
  const Folder* folder_at(const std::string& path);

  const std::string name_;
  const List files_in_, folders_in_;
  int64_t left_;  // names that may still be kept
  Folder top_;
};

}  // namespace traceflow
