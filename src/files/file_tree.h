#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "files/input_file.h"
#include "files/zip.h"

namespace traceflow {

// A read-only folder or a zip archive of one. Paths from its top name the files: "rgb/1x/a.png". Neither ".."
// nor absolute paths can leave it. Links in a folder are followed wherever they lead, since users link their
// images; an archive has none. A broken link counts as existing, so that opening it reports where it leads.
// Safe to use from several threads.
class FileTree {
 public:
  // If all files of an archive are in one folder, that folder is the top. Throws InputError for what is
  // neither a folder nor a zip archive, and for an archive with duplicate or impossible names.
  static std::shared_ptr<const FileTree> open(const std::filesystem::path& path);

  // The folder or archive, as given.
  const std::filesystem::path& path() const { return path_; }
  // Whether there is such a regular file. False for paths that leave the tree.
  bool has(const std::string& file) const;
  bool has_folder(const std::string& folder) const;
  // Sorted names of the files or folders in a folder ("" is the top); empty if there is no such folder. Both
  // lists contain broken links.
  std::vector<std::string> files_in(const std::string& folder) const;
  std::vector<std::string> folders_in(const std::string& folder) const;
  // Throws InputError if there is no such file.
  InputFile open_file(const std::string& file) const;
  // The file's name in errors.
  std::string name_of(const std::string& file) const { return (path_ / file).string(); }

 private:
  explicit FileTree(std::filesystem::path path) : path_(std::move(path)) {}
  void read_archive();
  std::vector<std::string> names_in(const std::string& folder, bool folders) const;
  // Whether there is an entry whose status satisfies `is_wanted`, or a broken link on the way to it.
  template <class F>
  bool has_entry(const std::string& inside, F&& is_wanted) const;

  std::filesystem::path path_;
  std::filesystem::path canonical_;  // for a folder
  std::optional<InputFile> archive_;
  std::map<std::string, ZipMember> members_;  // for an archive, by path from the top
};

// The path with "." and ".." resolved; nullopt if it is absolute, leaves the tree, or has characters that no
// path should have.
std::optional<std::string> path_in_tree(const std::string& path);

// A file of a tree; false if it names none.
struct TreeFile {
  std::shared_ptr<const FileTree> tree;
  std::string path;

  explicit operator bool() const { return tree != nullptr; }
  InputFile open() const { return tree->open_file(path); }
  std::string name() const { return tree->name_of(path); }
};

}  // namespace traceflow
