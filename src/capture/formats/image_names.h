#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "capture/formats/found_capture.h"

// What formats that name their images by paths have in common.
namespace traceflow {

// The order in which people count: digits compare as numbers, "a2" before "a10".
bool natural_less(const std::string& a, const std::string& b);

// The path with "/" between folders and without "./".
std::string tidy_path(std::string path);

// The name in a folder; "" is the top.
std::string in_folder(const std::string& folder, const std::string& name);

// The path without the extension of a picture; "train/f_1.5" has none.
std::string without_extension(const std::string& path);

// What photographs are called by, the usual first.
inline constexpr std::array image_extensions = {".png", ".jpg", ".jpeg", ".JPG", ".JPEG", ".PNG"};

// The image of this path, or of this path and an extension, or of the same path but its extension; empty
// where there is none. has: whether there is such a file.
std::string find_image(const std::function<bool(const std::string& file)>& has, const std::string& path);
std::string find_image(const FileTree& tree, const std::string& path);

// For each path, in any order, an id: without the folder that all share and the extension, "/" as "_". Throws
// InputError for paths that make no id, or the same; where: the file that names the i-th path, for it.
std::vector<std::string> image_ids(const std::vector<std::string>& paths,
                                   const std::function<std::string(size_t i)>& where);

// For each path its place among the names of all, and of `others`, in natural order and without extensions;
// the same names in several folders have the same place: cameras side by side.
std::vector<double> times_by_names(const std::vector<std::string>& paths,
                                   const std::vector<std::string>& others = {});

// Of views in their order every n-th, from the first on.
bool tests(size_t i, int test_every);

}  // namespace traceflow
