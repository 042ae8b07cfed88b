#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/tensor.h"

namespace traceflow::prepare {

// Files of a folder that look like pictures and are not hidden, ordered so that 9 comes before 10.
std::vector<std::filesystem::path> pictures_in(const std::filesystem::path& folder);

// The name without folder and endings: "a" of "b/a.png", "a.jpg", "a.png.png".
std::string stem_of(const std::string& name);

// A film, or the pictures of a folder one after the other, decoded by ffmpeg (film.h).
class PictureSource {
 public:
  // longest_side: larger pictures are scaled down to it; 0: none. log: where ffmpeg's words go. Throws
  // InputError where there is nothing to read.
  PictureSource(const std::filesystem::path& path, int longest_side, std::filesystem::path log,
                const std::atomic<bool>& stop);

  bool is_folder() const { return !files_.empty(); }
  // Of a folder's pictures, in UTF-8 (base/utf8.h); of a film, none.
  std::vector<std::string> names() const;
  // How many pictures there are; a film is decoded for it.
  int64_t count() const;

  using Take = std::function<void(int64_t index, Tensor<uint8_t>&& picture)>;
  // All, in order; their times in seconds, or their places in the folder. These throw InputError and Stopped.
  std::vector<double> take_all(bool grey, const Take& take) const;
  // Those of the given indices, which rise; `take` gets the place in `indices`.
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
