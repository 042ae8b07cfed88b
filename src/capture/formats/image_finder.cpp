#include "capture/formats/image_finder.h"

#include <algorithm>
#include <compare>
#include <utility>

#include "base/error.h"
#include "capture/formats/image_names.h"

namespace traceflow {

namespace {

// They take 0.5 GB.
constexpr int64_t most_names_kept = 4'000'000;

std::strong_ordering compare_letters(std::string_view a, std::string_view b) {
  const auto small = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  return std::lexicographical_compare_three_way(a.begin(), a.end(), b.begin(), b.end(),
                                                [&](char x, char y) { return small(x) <=> small(y); });
}

}  // namespace

bool ImageFinder::ByLetters::operator()(std::string_view a, std::string_view b) const {
  const std::strong_ordering order = compare_letters(a, b);
  return std::is_neq(order) ? std::is_lt(order) : a < b;
}
bool ImageFinder::ByLetters::operator()(std::string_view a, AnyCase b) const {
  return std::is_lt(compare_letters(a, b.name));
}
bool ImageFinder::ByLetters::operator()(AnyCase a, std::string_view b) const {
  return std::is_lt(compare_letters(a.name, b));
}

ImageFinder::ImageFinder(const FileTree& tree)
    : ImageFinder(
          tree.path().string(), [&tree](const std::string& folder) { return tree.files_in(folder); },
          [&tree](const std::string& folder) { return tree.folders_in(folder); },
          [&tree](const std::string& file) { return tree.has(file); }, most_names_kept) {}

ImageFinder::ImageFinder(std::string name, List files_in, List folders_in, Has has, int64_t most_names)
    : name_(std::move(name)),
      files_in_(std::move(files_in)),
      folders_in_(std::move(folders_in)),
      has_(std::move(has)),
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

ImageFinder::Place ImageFinder::place_of(const std::string& path) {
  Folder* folder = &top_;
  std::string listed;
  for (size_t begin = 0; begin < path.size() && !folder->seems_empty();) {
    const size_t end = std::min(path.find('/', begin), path.size());
    const std::string_view name = std::string_view(path).substr(begin, end - begin);
    auto next = folder->folders.find(name);
    if (next == folder->folders.end()) next = folder->folders.find(AnyCase{name});
    if (next == folder->folders.end()) return {};
    listed = in_folder(listed, next->first);
    if (next->second == nullptr) next->second = std::make_unique<Folder>(list(listed));
    folder = next->second.get();
    begin = end + 1;
  }
  return {folder, listed};
}

std::string ImageFinder::find(const std::string& path) {
  // Absolute paths are in no tree.
  if (path.starts_with('/')) return "";
  const size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "" : path.substr(0, slash);
  const std::string name = slash == std::string::npos ? path : path.substr(slash + 1);
  const Place place = place_of(folder);
  if (place.folder == nullptr) return "";
  if (place.folder->seems_empty()) return find_image(has_, path);
  const auto& files = place.folder->files;
  if (place.path == folder) {
    const std::string file = find_image([&](const std::string& f) { return files.contains(f); }, name);
    if (!file.empty()) return in_folder(folder, file);
  }
  const auto is_there = [&](const std::string& f) {
    return files.contains(AnyCase{f}) && has_(in_folder(folder, f));
  };
  const std::string file = find_image(is_there, name);
  return file.empty() ? "" : in_folder(place.path, *files.find(AnyCase{file}));
}

}  // namespace traceflow
