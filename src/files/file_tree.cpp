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

// The folder that contains all paths, with its slash; empty if there is none.
std::string common_folder(const std::map<std::string, ZipMember>& members) {
  if (members.empty()) return "";
  const std::string& first = members.begin()->first;
  const size_t slash = first.find('/');
  if (slash == std::string::npos) return "";
  const std::string folder = first.substr(0, slash + 1);
  const bool all =
      std::ranges::all_of(members, [&](const auto& member) { return member.first.starts_with(folder); });
  return all ? folder : "";
}

// How a link is broken: its target is missing, or the link leads back to itself.
enum class DeadEnd { none, missing, loop };

// Returns none for everything else, also for what cannot be examined.
DeadEnd dead_end(const fs::path& path) {
  std::error_code error;
  if (!fs::is_symlink(path, error)) return DeadEnd::none;
  const fs::file_status target = fs::status(path, error);
  if (error == std::errc::too_many_symbolic_link_levels) return DeadEnd::loop;
  return target.type() == fs::file_type::not_found ? DeadEnd::missing : DeadEnd::none;
}

// Describes the first broken link on the way to a file of a folder; nullopt if there is none.
std::optional<std::string> link_to_nowhere(const fs::path& folder, const std::string& inside) {
  fs::path at;
  for (const fs::path& part : fs::path(inside)) {
    at /= part;
    std::error_code error;
    if (!fs::exists(fs::symlink_status(folder / at, error))) return std::nullopt;
    const DeadEnd end = dead_end(folder / at);
    if (end == DeadEnd::none) continue;
    const fs::path target = fs::read_symlink(folder / at, error);
    return "the link " + at.generic_string() + " to " + target.string() +
           (end == DeadEnd::loop ? ", which leads back to itself" : ", which is not there");
  }
  return std::nullopt;
}

// What macOS adds to the archives that it makes.
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
    const std::optional<std::string> link = link_to_nowhere("", path.string());
    throw InputError(path.string(), "",
                     link                        ? *link
                     : error && fs::exists(path) ? error.message()
                                                 : "nothing",
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

template <class F>
bool FileTree::has_entry(const std::string& inside, F&& is_wanted) const {
  std::error_code error;
  const fs::file_status status = fs::status(canonical_ / inside, error);
  return is_wanted(status) || (!fs::exists(status) && link_to_nowhere(canonical_, inside).has_value());
}

bool FileTree::has(const std::string& file) const {
  const std::optional<std::string> inside = path_in_tree(file);
  if (!inside) return false;
  if (archive_) return members_.contains(*inside);
  return has_entry(*inside, [](const fs::file_status& status) { return fs::is_regular_file(status); });
}

bool FileTree::has_folder(const std::string& folder) const {
  const std::optional<std::string> inside = path_in_tree(folder);
  if (!inside) return false;
  if (archive_) {
    const auto next = members_.lower_bound(with_slash(*inside));
    return next != members_.end() && next->first.starts_with(with_slash(*inside));
  }
  return has_entry(*inside, [](const fs::file_status& status) { return fs::is_directory(status); });
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
    for (const fs::directory_entry& entry : fs::directory_iterator(canonical_ / *inside, error)) {
      std::error_code unreadable;
      const fs::file_status status = entry.status(unreadable);
      const bool matches = folders ? fs::is_directory(status) : fs::is_regular_file(status);
      if (matches || (!fs::exists(status) && dead_end(entry.path()) != DeadEnd::none))
        names.insert(entry.path().filename().string());
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
  if (const auto link = link_to_nowhere(canonical_, *inside)) {
    throw InputError(name_of(*inside), "", *link, "a readable file",
                     "make the link again, or put the files themselves there");
  }
  return {canonical_ / *inside, name_of(*inside)};
}

}  // namespace traceflow
