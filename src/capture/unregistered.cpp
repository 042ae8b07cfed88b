#include "capture/unregistered.h"

#include <filesystem>
#include <set>

#include "files/image.h"

namespace traceflow {

namespace {

namespace fs = std::filesystem;

std::string folder_of(const std::string& path) { return fs::path(path).parent_path().generic_string(); }
std::string stem_of(const std::string& path) { return fs::path(path).stem().string(); }

bool belongs(const std::string& stem, const std::set<std::string>& listed) {
  if (listed.contains(stem)) return true;
  for (size_t end = stem.find('_'); end != std::string::npos; end = stem.find('_', end + 1)) {
    if (listed.contains(stem.substr(0, end))) return true;
  }
  return false;
}

}  // namespace

std::vector<std::string> unregistered_images(const FileTree& tree, const FoundCapture& found) {
  std::set<std::string> folders, paths;
  std::set<std::string> listed(found.all_ids.begin(), found.all_ids.end());
  listed.insert(found.train_ids.begin(), found.train_ids.end());
  for (const auto* split : {&found.train, &found.test}) {
    for (const FoundView& view : *split) {
      folders.insert(folder_of(view.image.path));
      paths.insert(view.image.path);
      listed.insert(stem_of(view.image.path));
    }
  }
  std::vector<std::string> unregistered;
  for (const std::string& folder : folders) {
    for (const std::string& name : tree.files_in(folder)) {
      const std::string path = folder.empty() ? name : folder + "/" + name;
      if (has_image_name(name) && !paths.contains(path) && !belongs(stem_of(name), listed))
        unregistered.push_back(path);
    }
  }
  return unregistered;
}

}  // namespace traceflow
