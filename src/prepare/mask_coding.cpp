#include "prepare/mask_coding.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "files/image.h"

namespace traceflow::prepare {

namespace {

constexpr int half_level = 128;
// Difference of a pixel's channels. Palettes of labels differ by 64 and more; the colour that compression
// adds to grey is less.
constexpr int least_colour = 48;
constexpr double most_stray_colour = 0.01;  // share of the pixels
constexpr int most_grey_labels = 32;
// Share of the pixels that are not black and below 50 %: more than edges are.
constexpr double least_faint = 0.1;
// Share of the pixels with neither dark nor bright grey, above which the pictures are no masks.
constexpr double most_middle = 0.5;
// Share of the pixels that a background of labels has at least.
constexpr double least_background = 0.01;

struct Pixel {
  int level, spread;
  uint32_t colour;
};

Pixel pixel_at(const uint8_t* rgb) {
  const auto [least, most] = std::minmax({rgb[0], rgb[1], rgb[2]});
  return {(rgb[0] + rgb[1] + rgb[2]) / 3, most - least,
          uint32_t{rgb[0]} << 16 | uint32_t{rgb[1]} << 8 | uint32_t{rgb[2]}};
}

int64_t sum_of(const std::array<int64_t, 256>& levels, int begin, int end) {
  int64_t sum = 0;
  for (int level = begin; level < end; ++level) sum += levels[static_cast<size_t>(level)];
  return sum;
}

double fraction(int64_t part, int64_t all) {
  return all > 0 ? static_cast<double>(part) / static_cast<double>(all) : 0;
}

MaskCoding::Kind find_kind(const MaskStatistics& s, bool is_exact, const std::string& origin) {
  using Kind = MaskCoding::Kind;
  const std::string expected = "white and black, or labels of objects on black";
  const std::string remedy = "save masks as PNG files, white where something moves and black elsewhere";
  if (s.coloured() > 0 && is_exact && s.colours() <= MaskStatistics::most_labels) {
    if (fraction(s.black(), s.pixels()) >= least_background) return Kind::colours;
    throw InputError(origin, "masks", fmt::format("{} colours and no black background", s.colours()),
                     expected, remedy);
  }
  if (fraction(s.coloured(), s.pixels()) > most_stray_colour) {
    throw InputError(origin, "masks",
                     is_exact ? fmt::format("more than {} colours", MaskStatistics::most_labels)
                              : "colours in a film or JPEG files, which blur labels",
                     expected, remedy);
  }
  const auto& levels = s.levels();
  const auto shades = std::ranges::count_if(levels, [](int64_t pixels) { return pixels > 0; });
  if (is_exact && shades <= most_grey_labels && fraction(s.black(), s.pixels()) >= least_background) {
    const int64_t faint = sum_of(levels, 1, half_level), bright = sum_of(levels, half_level, 256);
    if (fraction(faint, faint + bright) > least_faint) return Kind::labels;
  }
  const double middle = fraction(sum_of(levels, 32, 224), s.pixels());
  if (middle > most_middle) {
    throw InputError(origin, "masks",
                     fmt::format("{:.0f}% of the pixels neither black nor white", 100 * middle), expected,
                     remedy);
  }
  return Kind::shades;
}

std::string name_of(MaskCoding::Kind kind, const MaskStatistics& s, int labels) {
  switch (kind) {
    case MaskCoding::Kind::shades:
      return "";
    case MaskCoding::Kind::labels:
      return fmt::format("labels 0 to {}: ", labels);
    case MaskCoding::Kind::colours:
      return fmt::format("palette of {} colours: ", s.colours());
  }
  throw InternalError("an unknown kind of masks");
}

}  // namespace

void MaskStatistics::add(const Tensor<uint8_t>& picture) {
  const int64_t height = picture.dim(0), width = picture.dim(1);
  // Soft and compressed edges would blur a ring of one pixel in large pictures.
  const int64_t ring = std::max<int64_t>(1, std::min(height, width) / 32);
  uint32_t last = ~0U;
  for (int64_t y = 0; y < height; ++y) {
    const bool is_border_row = y < ring || y >= height - ring;
    for (int64_t x = 0; x < width; ++x) {
      const Pixel pixel = pixel_at(&picture(y, x, 0));
      if (pixel.colour != last && colours() <= most_labels) colours_.insert(pixel.colour);
      last = pixel.colour;
      black_ += pixel.colour == 0 ? 1 : 0;
      const auto level = static_cast<size_t>(pixel.level);
      if (pixel.spread > least_colour) {
        ++coloured_;
      } else {
        ++levels_[level];
      }
      ++(is_border_row || x < ring || x >= width - ring ? border_ : inside_)[level];
    }
  }
  pixels_ += height * width;
}

MaskStatistics::White MaskStatistics::white(int level) const {
  const int64_t border = sum_of(border_, level, 256), inside = sum_of(inside_, level, 256);
  return {fraction(border, sum_of(border_, 0, 256)), fraction(inside, sum_of(inside_, 0, 256)),
          fraction(border + inside, pixels_)};
}

MaskCoding find_coding(const MaskStatistics& statistics, bool is_exact, MaskWhite asked,
                       const std::string& origin) {
  using Kind = MaskCoding::Kind;
  MaskCoding coding;
  coding.kind = find_kind(statistics, is_exact, origin);
  const auto& levels = statistics.levels();
  int labels = 255;
  while (labels > 0 && levels[static_cast<size_t>(labels)] == 0) --labels;
  const bool is_binary =
      coding.kind == Kind::shades || (coding.kind == Kind::labels && sum_of(levels, 1, labels) == 0);
  const std::string kind = name_of(coding.kind, statistics, labels);
  const std::string white = coding.kind == Kind::shades   ? "white"
                            : coding.kind == Kind::labels ? "all but 0"
                                                          : "all but black";
  if (asked != MaskWhite::automatic) {
    coding.white_moves = asked == MaskWhite::moving;
    coding.text = fmt::format("{}{} {}, as asked", kind, white, coding.white_moves ? "moving" : "static");
    return coding;
  }
  coding.text = fmt::format("{}{} assumed moving", kind, white);
  if (!is_binary) return coding;
  const auto share = statistics.white(coding.kind == Kind::shades ? half_level : 1);
  if (!(share.all > 0.5)) return coding;
  const std::string measured = fmt::format("it covers {:.0f}% of the border and {:.0f}% inside",
                                           100 * share.border, 100 * share.inside);
  // What moves seldom reaches the border of the pictures, and covers less of them than what does not move.
  coding.white_moves = !(share.border > share.inside);
  coding.text = coding.white_moves
                    ? fmt::format("{}, though {}; else --mask-white static", coding.text, measured)
                    : fmt::format("{}{} assumed static: {}", kind, white, measured);
  return coding;
}

Tensor<uint8_t> decoded_mask(const Tensor<uint8_t>& picture, const MaskCoding& coding) {
  Tensor<uint8_t> mask({picture.dim(0), picture.dim(1)});
  for (int64_t i = 0; i < mask.size(); ++i) {
    const Pixel pixel = pixel_at(&picture[3 * i]);
    const bool is_white =
        coding.kind == MaskCoding::Kind::shades ? pixel.level >= half_level : pixel.colour != 0;
    mask[i] = is_white == coding.white_moves ? 1 : 0;
  }
  return mask;
}

std::string take_masks(const PictureSource& source, const std::string& origin, MaskWhite white,
                       const std::vector<int64_t>& indices,
                       const std::function<void(int64_t place, const Tensor<uint8_t>& mask)>& take) {
  const std::vector<std::string> names = source.names();
  const bool is_exact = source.is_folder() && std::ranges::all_of(names, [](const std::string& name) {
                          constexpr std::array endings{".png", ".tif", ".tiff", ".bmp", ".ppm"};
                          return std::ranges::find(endings, lower_extension(name)) != endings.end();
                        });
  MaskStatistics statistics;
  source.take_some(false, indices, [&](int64_t, Tensor<uint8_t>&& picture) { statistics.add(picture); });
  const MaskCoding coding = find_coding(statistics, is_exact, white, origin);
  source.take_some(false, indices, [&](int64_t place, Tensor<uint8_t>&& picture) {
    take(place, decoded_mask(picture, coding));
  });
  return coding.text;
}

}  // namespace traceflow::prepare
