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

// Finds images like find_image (capture/formats/image_names.h), for files that name up to a million paths.
// Each folder of the tree is listed once, so missing names cost no system call. The system is called only if
// the lists cannot decide: for names that differ from a listed one only in case (some file systems ignore
// case), and in folders that appear empty (some can be entered but not listed). Not thread-safe.
class ImageFinder {
 public:
  // The names in a folder ("" is the top); empty if there is no such folder.
  using List = std::function<std::vector<std::string>(const std::string& folder)>;
  // Whether the file exists.
  using Has = std::function<bool(const std::string& file)>;

  // The tree must outlive the finder.
  explicit ImageFinder(const FileTree& tree);
  // The same with other sources of the lists. most_names: limit over all listed folders; name: of the tree,
  // for errors.
  ImageFinder(std::string name, List files_in, List folders_in, Has has, int64_t most_names);

  // path: as from tidy_path. Returns the path as listed. Throws InputError if the listed folders hold more
  // names than the limit: circular links create endless folders.
  std::string find(const std::string& path);

 private:
  // Finds a name in any case.
  struct AnyCase {
    std::string_view name;
  };
  // Ordered by letters without case, then by case.
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
    const Folder* folder = nullptr;  // null if there is none
    std::string path;                // as listed
  };

  Folder list(const std::string& path);
  // The folder, or the first folder on the way to it that appears empty.
  Place place_of(const std::string& path);

  const std::string name_;
  const List files_in_, folders_in_;
  const Has has_;
  int64_t left_;  // remaining names before the limit
  Folder top_;
};

}  // namespace traceflow
