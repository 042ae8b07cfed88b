#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "files/file_tree.h"

namespace traceflow {

// Finds images as find_image does (capture/formats/image_names.h), where a file may name a million paths:
// each folder of the tree is listed once, and what is not there costs no call of the system. The system is
// asked where lists do not tell: of names that differ from a listed one in the case of their letters alone,
// which some file systems ignore, and in folders that seem empty, since some may be entered but not listed.
// For one thread.
class ImageFinder {
 public:
  // The names in a folder ("" is the top); none where there is no such folder.
  using List = std::function<std::vector<std::string>(const std::string& folder)>;
  // Whether there is such a file.
  using Has = std::function<bool(const std::string& file)>;

  // The tree outlives the finder.
  explicit ImageFinder(const FileTree& tree);
  // The same with somebody else's lists. most_names: in all folders that are listed; name: of the tree, for
  // errors.
  ImageFinder(std::string name, List files_in, List folders_in, Has has, int64_t most_names);

  // path: as tidy_path makes it. What is found is called as it is listed. Throws InputError where the folders
  // that were looked into hold more names than are kept: links that lead back make folders without end.
  std::string find(const std::string& path);

 private:
  // Finds a name in any case.
  struct AnyCase {
    std::string_view name;
  };
  // By letters, and by their case where all of them are the same.
  struct ByLetters {
    using is_transparent = void;  // NOLINT(readability-identifier-naming): the library looks for it
    bool operator()(std::string_view a, std::string_view b) const;
    bool operator()(std::string_view a, AnyCase b) const;
    bool operator()(AnyCase a, std::string_view b) const;
  };
  struct Folder {
    std::set<std::string, ByLetters> files;
    std::map<std::string, std::unique_ptr<Folder>, ByLetters> folders;  // null: not listed yet
    bool seems_empty() const { return files.empty() && folders.empty(); }
  };
  struct Place {
    const Folder* folder = nullptr;  // null where there is none
    std::string path;                // as it is listed
  };

  Folder list(const std::string& path);
  // Of a folder, or of the first on the way to it that seems empty.
  Place place_of(const std::string& path);

  const std::string name_;
  const List files_in_, folders_in_;
  const Has has_;
  int64_t left_;  // names that may still be kept
  Folder top_;
};

}  // namespace traceflow
