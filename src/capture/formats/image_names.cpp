#include "capture/formats/image_names.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <set>

#include "base/error.h"
#include "base/printable.h"
#include "files/image.h"

namespace traceflow {

namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Returns the digits at `at` without leading zeros and moves `at` past them.
std::string_view take_number(const std::string& text, size_t& at) {
  size_t begin = at;
  while (at < text.size() && is_digit(text[at])) ++at;
  while (begin + 1 < at && text[begin] == '0') ++begin;
  return std::string_view(text).substr(begin, at - begin);
}

// Whether the extension is that of an unsupported image format. Such a file may have been converted since.
bool has_foreign_name(const std::filesystem::path& name) {
  constexpr std::array<std::string_view, 9> kinds = {".tif", ".tiff", ".bmp", ".webp", ".heic",
                                                     ".exr", ".dng",  ".ppm", ".jp2"};
  return std::ranges::find(kinds, lower_extension(name)) != kinds.end();
}

std::string bare_name(const std::string& path) {
  return std::filesystem::path(without_extension(path)).filename().string();
}

// The length of the common folder of all paths, including its last "/".
size_t shared_folder(const std::vector<std::string>& paths) {
  if (paths.empty()) return 0;
  size_t shared = paths[0].size();
  for (const std::string& path : paths) {
    const auto differ = std::mismatch(
        paths[0].begin(), paths[0].begin() + static_cast<std::ptrdiff_t>(std::min(shared, path.size())),
        path.begin());
    shared = static_cast<size_t>(differ.first - paths[0].begin());
  }
  const size_t slash = paths[0].substr(0, shared).rfind('/');
  return slash == std::string::npos ? 0 : slash + 1;
}

}  // namespace

bool natural_less(const std::string& a, const std::string& b) {
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      const std::string_view x = take_number(a, i), y = take_number(b, j);
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
      continue;
    }
    if (a[i] != b[j]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
    ++i, ++j;
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;
}

std::string tidy_path(std::string path) {
  std::ranges::replace(path, '\\', '/');
  return std::filesystem::path(path).lexically_normal().generic_string();
}

std::string in_folder(const std::string& folder, const std::string& name) {
  return folder.empty() ? name : folder + "/" + name;
}

std::string without_extension(const std::string& path) {
  const std::filesystem::path whole(path);
  if (!has_image_name(whole) && !has_foreign_name(whole)) return path;
  return std::filesystem::path(whole).replace_extension().generic_string();
}

std::string find_image(const std::function<bool(const std::string& file)>& has, const std::string& path) {
  if (has(path)) return path;
  for (const std::string& stem : {path, without_extension(path)}) {
    for (const char* extension : image_extensions) {
      if (has(stem + extension)) return stem + extension;
    }
  }
  return "";
}

std::string find_image(const FileTree& tree, const std::string& path) {
  return find_image([&](const std::string& file) { return tree.has(file); }, path);
}

std::vector<std::string> image_ids(const std::vector<std::string>& paths,
                                   const std::function<std::string(size_t i)>& where) {
  const size_t shared = shared_folder(paths);
  std::vector<std::string> ids;
  std::map<std::string, std::string> path_of;
  for (size_t i = 0; i < paths.size(); ++i) {
    const std::string& path = paths[i];
    std::string id = without_extension(path).substr(shared);
    std::ranges::replace(id, '/', '_');
    constexpr size_t longest = 200;
    if (id.empty() || id == "." || id == ".." || printable(id, longest) != id) {
      throw InputError(where(i), "image names", "\"" + printable(path, 60) + "\"",
                       "names that can name a file");
    }
    const auto [other, is_new] = path_of.emplace(id, path);
    if (!is_new) {
      throw InputError(where(i), "image names", other->second + " and " + path,
                       "names that differ by more than their extensions");
    }
    ids.push_back(std::move(id));
  }
  return ids;
}

std::vector<double> times_by_names(const std::vector<std::string>& paths,
                                   const std::vector<std::string>& others) {
  std::set<std::string, decltype(&natural_less)> names(&natural_less);
  for (const auto* list : {&paths, &others}) {
    for (const std::string& path : *list) names.insert(bare_name(path));
  }
  std::map<std::string, double> place;
  for (const std::string& name : names) place.emplace(name, static_cast<double>(place.size()));
  std::vector<double> times(paths.size());
  std::ranges::transform(paths, times.begin(),
                         [&](const std::string& path) { return place.at(bare_name(path)); });
  return times;
}

bool tests(size_t i, int test_every) { return test_every > 0 && i % static_cast<size_t>(test_every) == 0; }

}  // namespace traceflow
