#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/tensor.h"

namespace traceflow::prepare {

// Files of a folder with an image's extension that are not hidden, in natural order (9 before 10).
std::vector<std::filesystem::path> pictures_in(const std::filesystem::path& folder);

// The name without folder and extensions: "a" for "b/a.png", "a.jpg", "a.png.png".
std::string stem_of(const std::string& name);

// A video, or the images of a folder, decoded by ffmpeg (film.h).
class PictureSource {
 public:
  // longest_side: larger images are scaled down to it; 0: no limit. log: for ffmpeg's output. Throws
  // InputError if there is nothing to read.
  PictureSource(const std::filesystem::path& path, int longest_side, std::filesystem::path log,
                const std::atomic<bool>& stop);

  bool is_folder() const { return !files_.empty(); }
  // Of a folder's images, in UTF-8 (base/utf8.h); empty for a video.
  std::vector<std::string> names() const;
  // The number of images; a video is decoded to count them.
  int64_t count() const;

  using Take = std::function<void(int64_t index, Tensor<uint8_t>&& picture)>;
  // Reads all images in order. Returns their times in seconds, or their indices in the folder. Like
  // take_some, throws InputError and Stopped.
  std::vector<double> take_all(bool grey, const Take& take) const;
  // Reads the given ascending indices; `take` gets the position in `indices`.
  void take_some(bool grey, const std::vector<int64_t>& indices, const Take& take) const;

 private:
  std::vector<double> decode(bool grey, int64_t end, const std::function<bool(int64_t index)>& wanted,
                             const Take& take) const;

  std::filesystem::path path_;
  int longest_side_;
  std::filesystem::path log_;
  const std::atomic<bool>* stop_;
  std::vector<std::filesystem::path> files_;
};

}  // namespace traceflow::prepare
