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

// A folder that is only read, or a zip archive of one, its files named by paths from its top: "rgb/1x/a.png".
// No path leads out by its letters: neither ".." nor an absolute one. Links in a folder are followed wherever
// they lead, since people link their images; an archive has none. A link that leads nowhere counts as
// what is asked for, so that whoever needs it is told where it leads when it is opened. Safe to use from
// several threads.
class FileTree {
 public:
  // Where all of an archive lies in one folder, that folder is the top. Throws InputError for what is neither
  // a folder nor a zip archive, and for an archive with members of the same or of impossible names.
  static std::shared_ptr<const FileTree> open(const std::filesystem::path& path);

  // Of the folder or archive, as it was given.
  const std::filesystem::path& path() const { return path_; }
  // Whether there is such a regular file. False for paths that lead out.
  bool has(const std::string& file) const;
  bool has_folder(const std::string& folder) const;
  // Names of what lies in a folder ("" is the top), sorted; empty where there is no such folder. A link that
  // leads nowhere is among both.
  std::vector<std::string> files_in(const std::string& folder) const;
  std::vector<std::string> folders_in(const std::string& folder) const;
  // Throws InputError where there is no such file.
  InputFile open_file(const std::string& file) const;
  // How errors call it.
  std::string name_of(const std::string& file) const { return (path_ / file).string(); }

 private:
  explicit FileTree(std::filesystem::path path) : path_(std::move(path)) {}
  void read_archive();
  std::vector<std::string> names_in(const std::string& folder, bool folders) const;
  // Whether there is what `is_wanted` of its status says, or a link on the way there that leads nowhere.
  template <class F>
  bool has_entry(const std::string& inside, F&& is_wanted) const;

  std::filesystem::path path_;
  std::filesystem::path canonical_;  // of a folder
  std::optional<InputFile> archive_;
  std::map<std::string, ZipMember> members_;  // of the archive, by path from the top
};

// The path with its "." and ".." worked out; nothing where it is absolute, leads out of the tree, or has
// letters that no path should.
std::optional<std::string> path_in_tree(const std::string& path);

// A file of a tree; false where it names none.
struct TreeFile {
  std::shared_ptr<const FileTree> tree;
  std::string path;

  explicit operator bool() const { return tree != nullptr; }
  InputFile open() const { return tree->open_file(path); }
  std::string name() const { return tree->name_of(path); }
};

}  // namespace traceflow
