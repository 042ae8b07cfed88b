#include "capture/formats/unregistered.h"

#include <filesystem>
#include <set>

#include "capture/formats/image_names.h"
#include "files/image.h"

namespace traceflow {

namespace {

std::string folder_of(const std::string& path) {
  return std::filesystem::path(path).parent_path().generic_string();
}

// The folders of the views' images and, if these belong to a rig, the folders beside them.
std::set<std::string> folders_to_look_into(const FileTree& tree, const FoundCapture& found) {
  std::set<std::string> folders;
  for (const auto* split : {&found.train, &found.test}) {
    for (const FoundView& view : *split) folders.insert(folder_of(view.image.path));
  }
  const std::string& all = found.images.folder;
  std::set<std::string> rigs;
  for (const std::string& folder : folders) {
    if (!all.empty() && folder.starts_with(all + "/")) rigs.insert(folder_of(folder));
  }
  for (const std::string& rig : rigs) {
    for (const std::string& name : tree.folders_in(rig)) folders.insert(in_folder(rig, name));
  }
  return folders;
}

// Whether the path (without extension), or a beginning of its name that ends before a "_", is listed.
bool belongs(const std::string& path, const std::set<std::string>& listed) {
  if (listed.contains(path)) return true;
  const size_t name = path.rfind('/') == std::string::npos ? 0 : path.rfind('/') + 1;
  for (size_t end = path.find('_', name); end != std::string::npos; end = path.find('_', end + 1)) {
    if (listed.contains(path.substr(0, end))) return true;
  }
  return false;
}

}  // namespace

std::vector<std::string> unregistered_images(const FileTree& tree, const FoundCapture& found) {
  std::set<std::string> listed(found.listed_images.begin(), found.listed_images.end());
  for (const auto* split : {&found.train, &found.test}) {
    for (const FoundView& view : *split) listed.insert(without_extension(view.image.path));
  }
  std::vector<std::string> unregistered;
  for (const std::string& folder : folders_to_look_into(tree, found)) {
    for (const std::string& name : tree.files_in(folder)) {
      const std::string path = in_folder(folder, name);
      const bool is_image = has_image_name(name) && !name.starts_with('.');
      if (is_image && !belongs(without_extension(path), listed)) unregistered.push_back(path);
    }
  }
  return unregistered;
}

}  // namespace traceflow
