#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <unordered_set>
#include <vector>

#include "base/tensor.h"
#include "prepare/mask_white.h"
#include "prepare/picture_source.h"

// How the pictures of a source of masks say what moves. It is the same for all pictures of a source.
namespace traceflow::prepare {

// Counts over the pictures of a source.
class MaskStatistics {
 public:
  // picture: H×W×3.
  void add(const Tensor<uint8_t>& picture);

  int64_t pixels() const { return pixels_; }
  // Pixels of a colour that compression does not make of grey.
  int64_t coloured() const { return coloured_; }
  int64_t black() const { return black_; }
  // The different colours; at most most_labels + 1 are counted.
  int64_t colours() const { return static_cast<int64_t>(colours_.size()); }
  // Pixels of each grey level, coloured ones left out.
  const std::array<int64_t, 256>& levels() const { return levels_; }
  // Shares of the pixels that are white, along the border of the pictures and inside. white: at least this
  // level.
  struct White {
    double border = 0, inside = 0, all = 0;
  };
  White white(int level) const;

  static constexpr int64_t most_labels = 256;

 private:
  int64_t pixels_ = 0, coloured_ = 0, black_ = 0;
  std::unordered_set<uint32_t> colours_;
  std::array<int64_t, 256> levels_{}, border_{}, inside_{};
};

struct MaskCoding {
  enum class Kind {
    shades,  // white and black with edges of any grey
    labels,  // numbers of objects as grey levels, 0 for none
    colours  // colours of objects, black for none
  };
  Kind kind = Kind::shades;
  bool white_moves = true;  // or what is not black, 0
  std::string text;         // what was found and assumed
};

// is_exact: the files keep each pixel's value, which JPEG and most videos do not; only then can pictures hold
// labels. Throws InputError for pictures that are no masks; origin: named in it.
MaskCoding find_coding(const MaskStatistics& statistics, bool is_exact, MaskWhite asked,
                       const std::string& origin);

// H×W: 1 where something moves. picture: H×W×3.
Tensor<uint8_t> decoded_mask(const Tensor<uint8_t>& picture, const MaskCoding& coding);

// Reads pictures of a source as masks, first all of them for the coding, then again for the masks; indices
// and place as in PictureSource::take_some. Returns what was found and assumed. Throws InputError and
// Stopped.
std::string take_masks(const PictureSource& source, const std::string& origin, MaskWhite white,
                       const std::vector<int64_t>& indices,
                       const std::function<void(int64_t place, const Tensor<uint8_t>& mask)>& take);

}  // namespace traceflow::prepare
