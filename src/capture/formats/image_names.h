#pragma once

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

// The image of this path, or one of the same path but its extension, or with one where it has none; empty
// where there is neither.
std::string find_image(const FileTree& tree, const std::string& path);

// The largest scale that `downscale` is a multiple of and at which path_at(scale) is an image; else full
// size.
StoredImages choose_stored_images(const FileTree& tree, int downscale,
                                  const std::function<std::string(int stored)>& path_at);

// For each path, in any order, an id: without the folder that all share and the extension, "/" as "_". Throws
// InputError naming `where` for paths that make no id, or the same.
std::vector<std::string> image_ids(const std::vector<std::string>& paths, const std::string& where);

// For each path its place among the file names in natural order; the same names in several folders have the
// same place: cameras side by side.
std::vector<double> times_by_names(const std::vector<std::string>& paths);

// Of views in their order every n-th, from the first on.
bool tests(size_t i, int test_every);

}  // namespace traceflow
