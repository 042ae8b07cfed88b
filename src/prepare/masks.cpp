#include "prepare/masks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "capture/lens/lens.h"
#include "capture/lens/resample.h"
#include "capture/sharpness.h"
#include "files/png.h"
#include "prepare/mask_coding.h"
#include "prepare/motion/moving_mask.h"
#include "prepare/picture_source.h"
#include "prepare/programs.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;

constexpr int64_t estimated_at = 480;  // pixels of the longest side

struct Scaled {
  Tensor<uint8_t> grey;  // H×W×1
  double factor = 1;     // pixels of the original image per pixel of `grey`
};

Scaled small_grey(const fs::path& path) {
  const Tensor<uint8_t> grey = grey_of(read_png(path));
  const int64_t longest = std::max(grey.dim(0), grey.dim(1));
  if (longest <= estimated_at) return {grey, 1};
  const double factor = static_cast<double>(longest) / estimated_at;
  const auto side = [&](int64_t pixels) {
    return static_cast<int64_t>(static_cast<double>(pixels) / factor);
  };
  return {to_8bit(resample(from_8bit(grey), {side(grey.dim(1)), side(grey.dim(0)), factor, factor})), factor};
}

// Calls f(frame, mask) for every frame with a mask in --masks. Returns what was assumed about the masks.
std::string take_supplied(const PrepareOptions& options, const Frames& frames, const fs::path& log,
                          const Work& work,
                          const std::function<void(const Frame& frame, const Tensor<uint8_t>& mask)>& f) {
  const PictureSource source(options.masks, 0, log, work.stop());
  const std::vector<std::optional<int64_t>> matched =
      match_masks(options.masks, source.names(), source.count(), frames);
  std::map<int64_t, const Frame*> wanted;
  for (size_t i = 0; i < matched.size(); ++i) {
    if (matched[i]) wanted[*matched[i]] = &frames.frames[i];
  }
  std::vector<int64_t> indices;
  indices.reserve(wanted.size());
  for (const auto& [index, frame] : wanted) indices.push_back(index);
  const auto take = [&](int64_t place, const Tensor<uint8_t>& mask) {
    f(*wanted.at(indices[static_cast<size_t>(place)]), mask);
    work.tell(place + 1, static_cast<int64_t>(indices.size()));
  };
  return take_masks(source, options.masks, options.mask_white, indices, take);
}

using Matched = std::vector<std::optional<int64_t>>;

// place(frame) of each frame, if all frames of the first camera have one.
template <class Place>
std::optional<Matched> all_matched(const Frames& frames, Place&& place) {
  Matched matched;
  for (const Frame& frame : frames.frames) {
    matched.push_back(place(frame));
    if (frame.camera == 0 && !matched.back()) return std::nullopt;
  }
  return matched;
}

void require_one_each(const std::string& origin, const Matched& matched, const Frames& frames) {
  std::map<int64_t, const Frame*> owners;
  for (size_t i = 0; i < matched.size(); ++i) {
    if (!matched[i]) continue;
    const auto [owner, is_first] = owners.emplace(*matched[i], &frames.frames[i]);
    if (is_first) continue;
    throw InputError(
        origin, "masks", fmt::format("one for both {} and {}", owner->second->id, frames.frames[i].id),
        "one for each frame", "name the pictures and their masks differently before their endings");
  }
}

}  // namespace

bool wants_masks(const PrepareOptions& options) { return options.masks != "none"; }

std::vector<std::optional<int64_t>> match_masks(const std::string& origin,
                                                const std::vector<std::string>& names, int64_t count,
                                                const Frames& frames) {
  std::map<std::string, int64_t> by_name;
  for (size_t i = 0; i < names.size(); ++i) by_name.emplace(stem_of(names[i]), static_cast<int64_t>(i));
  const auto named = [&](const std::string& name) -> std::optional<int64_t> {
    const auto found = by_name.find(name);
    return found == by_name.end() ? std::nullopt : std::optional(found->second);
  };
  const auto first_camera =
      std::ranges::count_if(frames.frames, [](const Frame& frame) { return frame.camera == 0; });
  const int64_t of_film = frames.source_frames.front();
  int64_t order = 0;
  std::optional<Matched> matched =
      all_matched(frames, [&](const Frame& frame) { return named(stem_of(frame.source)); });
  if (!matched && count == of_film) {
    matched = all_matched(frames, [&](const Frame& frame) {
      return frame.camera == 0 ? std::optional(frame.index) : std::nullopt;
    });
  }
  if (!matched) matched = all_matched(frames, [&](const Frame& frame) { return named(frame.id); });
  if (!matched && count == first_camera) {
    matched = all_matched(frames, [&](const Frame& frame) {
      return frame.camera == 0 ? std::optional(order++) : std::nullopt;
    });
  }
  if (!matched) {
    throw InputError(origin, "masks", fmt::format("{}, not all of them with a frame's name", count),
                     fmt::format("one for each of {} frames, or of the {} pictures they were taken from",
                                 first_camera, of_film),
                     "see the frames' names with --until frames");
  }
  require_one_each(origin, *matched, frames);
  return *matched;
}

void estimate_masks(const std::vector<fs::path>& pictures,
                    const std::function<std::optional<TwoView>(int64_t i, int64_t j)>& lines,
                    const Work& work,
                    const std::function<void(int64_t i, const Tensor<uint8_t>& mask)>& take) {
  if (pictures.empty()) return;
  const double factor = small_grey(pictures.front()).factor;
  const std::vector<Tensor<uint8_t>> masks = moving_masks(
      static_cast<int64_t>(pictures.size()),
      [&](int64_t i) { return small_grey(pictures[static_cast<size_t>(i)]).grey; },
      [&](int64_t i, int64_t j) -> std::optional<TwoView> {
        const auto known = lines(i, j);
        if (!known) return std::nullopt;
        return in_larger_pixels(*known, factor);
      },
      work);
  for (size_t i = 0; i < masks.size(); ++i) {
    const PngSize size = read_png_size(pictures[i]);
    take(static_cast<int64_t>(i), resized_mask(masks[i], size.height, size.width));
  }
}

std::string make_masks(const PrepareOptions& options, const Frames& frames, const fs::path& pictures,
                       const fs::path& masks, const fs::path& log, const Work& work) {
  fs::remove_all(masks);
  if (!wants_masks(options)) return "none";
  fs::create_directories(masks);
  double covered = 0;
  int64_t count = 0;
  std::string assumed;
  const auto keep = [&](const Frame& frame, const Tensor<uint8_t>& mask) {
    require_proportions(options.masks, "masks", {mask.dim(1), mask.dim(0)}, frame.id,
                        static_cast<double>(frame.width), static_cast<double>(frame.height));
    write_mask(masks / (frame.id + ".png"), resized_mask(mask, frame.height, frame.width));
    covered += share_of(mask);
    ++count;
  };
  if (options.masks != "estimate") {
    assumed = " (" + take_supplied(options, frames, log, work, keep) + ")";
    require_white(options.masks, covered);
  } else {
    for (const int camera : {0, 1}) {
      std::vector<const Frame*> mine;
      std::vector<fs::path> files;
      for (const Frame& frame : frames.frames) {
        if (frame.camera != camera) continue;
        mine.push_back(&frame);
        files.push_back(pictures / (frame.id + ".png"));
      }
      estimate_masks(
          files, [](int64_t, int64_t) { return std::nullopt; }, work,
          [&](int64_t i, const Tensor<uint8_t>& mask) { keep(*mine[static_cast<size_t>(i)], mask); });
    }
  }
  return fmt::format("{} {}, covering {:.1f}% of the pixels{}",
                     options.masks == "estimate" ? fmt::format("{}", count)
                                                 : fmt::format("{} of {}", count, frames.frames.size()),
                     options.masks == "estimate" ? "estimated" : "supplied",
                     100 * covered / static_cast<double>(std::max<int64_t>(1, count)), assumed);
}

void write_mask(const fs::path& path, const Tensor<uint8_t>& mask) {
  Tensor<uint8_t> picture = mask;
  for (uint8_t& value : picture.values()) value = value != 0 ? 255 : 0;
  write_png(path, picture);
}

Tensor<uint8_t> as_mask(const Tensor<uint8_t>& picture) {
  Tensor<uint8_t> mask({picture.dim(0), picture.dim(1)});
  const int64_t channels = picture.dim(2);
  for (int64_t i = 0; i < mask.size(); ++i) mask[i] = picture[i * channels] >= 128 ? 1 : 0;
  return mask;
}

Tensor<uint8_t> resized_mask(const Tensor<uint8_t>& mask, int64_t height, int64_t width) {
  if (mask.dim(0) == height && mask.dim(1) == width) return mask;
  Tensor<uint8_t> result({height, width});
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x)
      result(y, x) = mask((2 * y + 1) * mask.dim(0) / (2 * height), (2 * x + 1) * mask.dim(1) / (2 * width));
  }
  return result;
}

void require_proportions(const std::string& origin, const std::string& field, const Vec2<int64_t>& size,
                         const std::string& picture, double width, double height) {
  if (same_proportions(static_cast<double>(size.x), static_cast<double>(size.y), width, height)) return;
  throw InputError(origin, field, fmt::format("{}×{} for {}", size.x, size.y, picture),
                   fmt::format("the proportions of {}×{}", width, height),
                   "turn or cut them as the pictures are");
}

void require_white(const std::string& origin, double covered) {
  if (!(covered > 0))
    throw InputError(origin, "masks", "nothing that moves in any", "the moving object white");
}

double share_of(const Tensor<uint8_t>& mask) {
  int64_t ones = 0;
  for (const uint8_t value : mask.values()) ones += value != 0 ? 1 : 0;
  return mask.empty() ? 0 : static_cast<double>(ones) / static_cast<double>(mask.size());
}

}  // namespace traceflow::prepare
