#include "files/file_tree.h"

#include <algorithm>
#include <set>
#include <system_error>

#include "base/error.h"

namespace traceflow {

namespace {

namespace fs = std::filesystem;

constexpr size_t longest_path = 4096;

std::string with_slash(const std::string& folder) { return folder.empty() ? "" : folder + "/"; }

// The folder that all paths lie in, with its slash; empty where there is none.
std::string common_folder(const std::map<std::string, ZipMember>& members) {
  if (members.empty()) return "";
  const std::string& first = members.begin()->first;
  const size_t slash = first.find('/');
  if (slash == std::string::npos) return "";
  const std::string folder = first.substr(0, slash + 1);
  const bool all = std::all_of(members.begin(), members.end(),
                               [&](const auto& member) { return member.first.starts_with(folder); });
  return all ? folder : "";
}

// What a Mac adds to an archive that it makes.
bool is_clutter(const std::string& path) { return path.starts_with("__MACOSX/") || path == ".DS_Store"; }

}  // namespace

std::optional<std::string> path_in_tree(const std::string& path) {
  if (path.size() > longest_path || path.starts_with('/') || path.find('\0') != std::string::npos ||
      path.find('\\') != std::string::npos) {
    return std::nullopt;
  }
  const std::string result = fs::path(path).lexically_normal().generic_string();
  if (result == ".." || result.starts_with("../")) return std::nullopt;
  if (result == ".") return "";
  return result.ends_with('/') ? result.substr(0, result.size() - 1) : result;
}

std::shared_ptr<const FileTree> FileTree::open(const fs::path& path) {
  std::shared_ptr<FileTree> tree(new FileTree(path));
  std::error_code error;
  if (fs::is_directory(path, error)) {
    tree->canonical_ = fs::canonical(path);
  } else if (fs::is_regular_file(path, error)) {
    tree->read_archive();
  } else {
    throw InputError(path.string(), "", error && fs::exists(path) ? error.message() : "nothing",
                     "a folder or a zip archive");
  }
  return tree;
}

void FileTree::read_archive() {
  archive_.emplace(path_);
  std::map<std::string, ZipMember> members;
  for (ZipMember& member : list_zip(*archive_)) {
    if (member.name.ends_with('/') || is_clutter(member.name)) continue;
    const std::optional<std::string> name = path_in_tree(member.name);
    if (!name || name->empty()) {
      throw InputError(path_.string(), "", "a member \"" + member.name.substr(0, 200) + "\"",
                       "members inside the archive's own folder", "pack the archive again");
    }
    if (!members.emplace(*name, member).second) {
      throw InputError(path_.string(), "", "two members " + *name, "each name once",
                       "pack the archive again");
    }
  }
  const size_t top = common_folder(members).size();
  for (auto& [name, member] : members) members_.emplace(name.substr(top), std::move(member));
}

bool FileTree::has(const std::string& file) const {
  const std::optional<std::string> inside = path_in_tree(file);
  if (!inside) return false;
  if (archive_) return members_.contains(*inside);
  std::error_code error;
  return fs::is_regular_file(path_ / *inside, error);
}

bool FileTree::has_folder(const std::string& folder) const {
  const std::optional<std::string> inside = path_in_tree(folder);
  if (!inside) return false;
  if (archive_) {
    const auto next = members_.lower_bound(with_slash(*inside));
    return next != members_.end() && next->first.starts_with(with_slash(*inside));
  }
  std::error_code error;
  const fs::path target = follow(*inside, error);
  return lies_inside(target) && fs::is_directory(target, error);
}

std::vector<std::string> FileTree::names_in(const std::string& folder, bool folders) const {
  const std::optional<std::string> inside = path_in_tree(folder);
  if (!inside) return {};
  std::set<std::string> names;
  if (archive_) {
    const std::string begin = with_slash(*inside);
    for (auto at = members_.lower_bound(begin); at != members_.end() && at->first.starts_with(begin); ++at) {
      const size_t slash = at->first.find('/', begin.size());
      if ((slash != std::string::npos) == folders) {
        names.insert(at->first.substr(begin.size(), folders ? slash - begin.size() : std::string::npos));
      }
    }
  } else {
    std::error_code error;
    const fs::path target = follow(*inside, error);
    if (!lies_inside(target)) return {};
    for (const fs::directory_entry& entry : fs::directory_iterator(target, error)) {
      std::error_code unreadable;
      const bool matches = folders ? entry.is_directory(unreadable) : entry.is_regular_file(unreadable);
      const bool leads_out = matches && folders && entry.is_symlink(unreadable) &&
                             !lies_inside(fs::canonical(entry.path(), unreadable));
      if (matches && !leads_out) names.insert(entry.path().filename().string());
    }
  }
  return {names.begin(), names.end()};
}

std::vector<std::string> FileTree::files_in(const std::string& folder) const {
  return names_in(folder, false);
}
std::vector<std::string> FileTree::folders_in(const std::string& folder) const {
  return names_in(folder, true);
}

InputFile FileTree::open_file(const std::string& file) const {
  const std::optional<std::string> inside = path_in_tree(file);
  if (!inside) throw InputError(path_.string(), "", "the path " + file, "a path inside the capture");
  if (archive_) {
    const auto found = members_.find(*inside);
    if (found == members_.end()) throw InputError(name_of(*inside), "", "nothing", "a file of the archive");
    const ZipMember& member = found->second;
    if (member.deflated) return inflate_to_scratch(*archive_, member).renamed(name_of(*inside));
    return archive_->part(member.offset, member.size, name_of(*inside));
  }
  std::error_code error;
  const fs::path target = follow(*inside, error);
  if (error) throw InputError(name_of(*inside), "", error.message(), "a readable file");
  if (!lies_inside(target)) {
    throw InputError(name_of(*inside), "", "a link out of the folder, to " + target.string(),
                     "files inside it", "copy the file there");
  }
  return InputFile::below(canonical_, target.lexically_relative(canonical_), name_of(*inside));
}

fs::path FileTree::follow(const std::string& inside, std::error_code& error) const {
  fs::path at = canonical_;
  for (const fs::path& part : fs::path(inside)) {
    at /= part;
    if (fs::is_symlink(at, error)) return fs::canonical(canonical_ / inside, error);
  }
  // What is not there says so when it is opened.
  error.clear();
  return at;
}

bool FileTree::lies_inside(const fs::path& target) const {
  return std::mismatch(canonical_.begin(), canonical_.end(), target.begin(), target.end()).first ==
         canonical_.end();
}

}  // namespace traceflow
