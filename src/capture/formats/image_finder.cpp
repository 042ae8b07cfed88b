#include "capture/formats/image_finder.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "capture/formats/image_names.h"

namespace traceflow {

namespace {

// They take half a gigabyte.
constexpr int64_t most_names_kept = 4'000'000;

}  // namespace

ImageFinder::ImageFinder(const FileTree& tree)
    : ImageFinder(
          tree.path().string(), [&tree](const std::string& folder) { return tree.files_in(folder); },
          [&tree](const std::string& folder) { return tree.folders_in(folder); }, most_names_kept) {}

ImageFinder::ImageFinder(std::string name, List files_in, List folders_in, int64_t most_names)
    : name_(std::move(name)),
      files_in_(std::move(files_in)),
      folders_in_(std::move(folders_in)),
      left_(most_names),
      top_(list("")) {}

ImageFinder::Folder ImageFinder::list(const std::string& path) {
  const std::vector<std::string> files = files_in_(path), folders = folders_in_(path);
  // An empty folder counts too.
  left_ -= 1 + static_cast<int64_t>(files.size() + folders.size());
  if (left_ < 0) {
    throw InputError(name_, "", "more names than are kept in the folders where images are looked for",
                     "folders of images", "take away links that lead back and what is no part of it");
  }
  Folder folder;
  folder.files.insert(files.begin(), files.end());
  for (const std::string& name : folders) folder.folders.emplace(name, nullptr);
  return folder;
}

const ImageFinder::Folder* ImageFinder::folder_at(const std::string& path) {
  Folder* folder = &top_;
  for (size_t begin = 0; begin < path.size();) {
    const size_t end = std::min(path.find('/', begin), path.size());
    const auto next = folder->folders.find(std::string_view(path).substr(begin, end - begin));
    if (next == folder->folders.end()) return nullptr;
    if (next->second == nullptr) next->second = std::make_unique<Folder>(list(path.substr(0, end)));
    folder = next->second.get();
    begin = end + 1;
  }
  return folder;
}

std::string ImageFinder::find(const std::string& path) {
  // From the root: in no tree.
  if (path.starts_with('/')) return "";
  const size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "" : path.substr(0, slash);
  const Folder* there = folder_at(folder);
  if (there == nullptr) return "";
  const auto has = [&](const std::string& file) { return there->files.contains(file); };
  const std::string name = find_image(has, slash == std::string::npos ? path : path.substr(slash + 1));
  return name.empty() ? "" : in_folder(folder, name);
}

}  // namespace traceflow
