#include "prepare/picture_source.h"

#include <algorithm>
#include <array>

#include "base/error.h"
#include "base/utf8.h"
#include "capture/formats/image_names.h"
#include "files/image.h"
#include "prepare/film.h"
#include "prepare/programs.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;

bool is_picture(const fs::path& path) {
  // macOS stores a metadata file beside each image on foreign file systems: ._IMG_0001.jpg.
  if (path.filename().string().starts_with('.')) return false;
  constexpr std::array endings{".png",  ".jpg", ".jpeg", ".tif", ".tiff",
                               ".webp", ".bmp", ".ppm",  ".exr", ".dng"};
  return std::ranges::find(endings, lower_extension(path)) != endings.end();
}

}  // namespace

std::vector<fs::path> pictures_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && is_picture(entry.path())) files.push_back(entry.path());
  }
  std::ranges::sort(files, [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  });
  return files;
}

std::string stem_of(const std::string& name) {
  std::string stem = fs::path(name).stem().string();
  return is_picture(stem) ? fs::path(stem).stem().string() : stem;
}

PictureSource::PictureSource(const fs::path& path, int longest_side, fs::path log,
                             const std::atomic<bool>& stop)
    : path_(path), longest_side_(longest_side), log_(std::move(log)), stop_(&stop) {
  if (fs::is_directory(path)) {
    files_ = pictures_in(path);
    if (files_.empty()) throw InputError(path.string(), "", "no pictures", "PNG or JPEG files, or a film");
  } else if (!fs::is_regular_file(path)) {
    throw InputError(path.string(), "", fs::exists(path) ? "neither file nor folder" : "nothing",
                     "a film or a folder of pictures");
  }
}

std::vector<std::string> PictureSource::names() const {
  std::vector<std::string> names;
  names.reserve(files_.size());
  for (const fs::path& file : files_) names.push_back(as_utf8(file.filename().string()));
  return names;
}

int64_t PictureSource::count() const {
  auto count = static_cast<int64_t>(files_.size());
  if (!is_folder()) take_all(true, [&](int64_t, Tensor<uint8_t>&&) { ++count; });
  return count;
}

std::vector<double> PictureSource::decode(bool grey, int64_t end,
                                          const std::function<bool(int64_t index)>& wanted,
                                          const Take& take) const {
  need_program("ffmpeg");
  if (!is_folder()) {
    return decode_film({path_, longest_side_, grey}, log_, *stop_, [&](int64_t i, Tensor<uint8_t>&& picture) {
      if (wanted(i)) take(i, std::move(picture));
      return i + 1 < end;
    });
  }
  std::vector<double> places;
  for (int64_t i = 0; i < std::min(end, static_cast<int64_t>(files_.size())); ++i) {
    places.push_back(static_cast<double>(i));
    if (wanted(i))
      take(i, decode_picture({files_[static_cast<size_t>(i)], longest_side_, grey, true}, log_, *stop_));
  }
  return places;
}

std::vector<double> PictureSource::take_all(bool grey, const Take& take) const {
  return decode(
      grey, INT64_MAX, [](int64_t) { return true; }, take);
}

void PictureSource::take_some(bool grey, const std::vector<int64_t>& indices, const Take& take) const {
  if (indices.empty()) return;
  size_t next = 0;
  decode(
      grey, indices.back() + 1, [&](int64_t i) { return next < indices.size() && indices[next] == i; },
      [&](int64_t, Tensor<uint8_t>&& picture) { take(static_cast<int64_t>(next++), std::move(picture)); });
  if (next == indices.size()) return;
  throw InputError(
      path_.string(), "",
      std::to_string(next) + " of " + std::to_string(indices.size()) + " pictures the second time",
      "the same film twice");
}

}  // namespace traceflow::prepare
