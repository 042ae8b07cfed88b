#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "capture/formats/found_capture.h"

// Common functions of formats that name images by paths.
namespace traceflow {

// Natural order: digits compare as numbers, so "a2" precedes "a10".
bool natural_less(const std::string& a, const std::string& b);

// The path with "/" as separator and without "./".
std::string tidy_path(std::string path);

// The name's path in a folder; "" is the top.
std::string in_folder(const std::string& folder, const std::string& name);

// The path without an image's extension; "train/f_1.5" has none.
std::string without_extension(const std::string& path);

// Extensions of photographs, the most common first.
inline constexpr std::array image_extensions = {".png", ".jpg", ".jpeg", ".JPG", ".JPEG", ".PNG"};

// The image with this path, or with this path plus an extension, or with another extension instead; empty if
// there is none. has: whether a file exists.
std::string find_image(const std::function<bool(const std::string& file)>& has, const std::string& path);
std::string find_image(const FileTree& tree, const std::string& path);

// An id for each path: without the common folder and the extension, "/" replaced by "_". The paths may be in
// any order. Throws InputError for paths that give no id or equal ids; where: the file that names the i-th
// path, for the error.
std::vector<std::string> image_ids(const std::vector<std::string>& paths,
                                   const std::function<std::string(size_t i)>& where);

// The rank of each path's name among all names and those of `others`, in natural order, without extensions.
// Equal names in different folders have the same rank: they come from cameras side by side.
std::vector<double> times_by_names(const std::vector<std::string>& paths,
                                   const std::vector<std::string>& others = {});

// Whether the i-th view tests: every n-th view, from the first.
bool tests(size_t i, int test_every);

}  // namespace traceflow
