#include "prepare/masks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "capture/lens/resample.h"
#include "capture/sharpness.h"
#include "files/png.h"
#include "prepare/motion/moving_mask.h"
#include "prepare/picture_source.h"
#include "prepare/programs.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;

constexpr int64_t estimated_at = 480;  // pixels of the longest side

struct Scaled {
  Tensor<uint8_t> grey;  // H×W×1
  double factor = 1;     // of the picture's pixels, in its own
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

// f(frame, mask) for every frame that --masks has a mask of.
void take_supplied(const PrepareOptions& options, const Frames& frames, const fs::path& log,
                   const std::atomic<bool>& stop,
                   const std::function<void(const Frame& frame, const Tensor<uint8_t>& mask)>& f) {
  const PictureSource source(options.masks, 0, log, stop);
  const std::vector<std::string> names = source.names();
  auto count = static_cast<int64_t>(names.size());
  if (!source.is_folder()) source.take_all(true, [&](int64_t, Tensor<uint8_t>&&) { ++count; });
  std::map<int64_t, const Frame*> wanted;
  const std::vector<std::optional<int64_t>> matched = match_masks(options.masks, names, count, frames);
  for (size_t i = 0; i < matched.size(); ++i) {
    if (matched[i]) wanted[*matched[i]] = &frames.frames[i];
  }
  std::vector<int64_t> indices;
  indices.reserve(wanted.size());
  for (const auto& [index, frame] : wanted) indices.push_back(index);
  source.take_some(true, indices, [&](int64_t place, Tensor<uint8_t>&& picture) {
    f(*wanted.at(indices[static_cast<size_t>(place)]), as_mask(picture));
  });
}

}  // namespace

bool wants_masks(const PrepareOptions& options) { return options.masks != "none"; }

std::vector<std::optional<int64_t>> match_masks(const std::string& origin,
                                                const std::vector<std::string>& names, int64_t count,
                                                const Frames& frames) {
  std::map<std::string, int64_t> by_name;
  for (size_t i = 0; i < names.size(); ++i) by_name.emplace(stem_of(names[i]), static_cast<int64_t>(i));
  std::vector<std::optional<int64_t>> matched(frames.frames.size());
  int64_t named = 0, first_camera = 0;
  for (size_t i = 0; i < matched.size(); ++i) {
    const Frame& frame = frames.frames[i];
    first_camera += frame.camera == 0 ? 1 : 0;
    for (const std::string& name : {frame.id, stem_of(frame.source)}) {
      const auto found = by_name.find(name);
      if (name.empty() || found == by_name.end()) continue;
      matched[i] = found->second;
      ++named;
      break;
    }
  }
  if (named >= first_camera) return matched;
  const bool of_frames = count == first_camera, of_film = count == frames.source_frames.front();
  if (!of_frames && !of_film) {
    throw InputError(origin, "masks", fmt::format("{}, of which {} have a frame's name", count, named),
                     fmt::format("one for each of {} frames, or of the {} pictures they were taken from",
                                 first_camera, frames.source_frames.front()),
                     "see the frames' names with --until frames");
  }
  int64_t place = 0;
  for (size_t i = 0; i < matched.size(); ++i) {
    matched[i].reset();
    if (frames.frames[i].camera != 0) continue;
    matched[i] = of_frames ? place++ : frames.frames[i].index;
  }
  return matched;
}

void estimate_masks(const std::vector<fs::path>& pictures,
                    const std::function<std::optional<TwoView>(int64_t i, int64_t j)>& lines,
                    const std::atomic<bool>& stop,
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
      stop);
  if (stop) throw Stopped{};
  for (size_t i = 0; i < masks.size(); ++i) {
    const PngSize size = read_png_size(pictures[i]);
    take(static_cast<int64_t>(i), resized_mask(masks[i], size.height, size.width));
  }
}

std::string make_masks(const PrepareOptions& options, const Frames& frames, const fs::path& pictures,
                       const fs::path& masks, const fs::path& log, const std::atomic<bool>& stop) {
  fs::remove_all(masks);
  if (!wants_masks(options)) return "none";
  fs::create_directories(masks);
  double covered = 0;
  int64_t count = 0;
  const auto keep = [&](const Frame& frame, const Tensor<uint8_t>& mask) {
    write_mask(masks / (frame.id + ".png"), resized_mask(mask, frame.height, frame.width));
    covered += share_of(mask);
    ++count;
  };
  if (options.masks != "estimate") {
    take_supplied(options, frames, log, stop, keep);
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
          files, [](int64_t, int64_t) { return std::nullopt; }, stop,
          [&](int64_t i, const Tensor<uint8_t>& mask) { keep(*mine[static_cast<size_t>(i)], mask); });
    }
  }
  return fmt::format("{} {}, covering {:.1f}% of the pixels", count,
                     options.masks == "estimate" ? "estimated" : "supplied",
                     100 * covered / static_cast<double>(std::max<int64_t>(1, count)));
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

void require_white(const std::string& origin, double covered) {
  if (!(covered > 0)) throw InputError(origin, "masks", "nothing white in any", "the moving object white");
}

double share_of(const Tensor<uint8_t>& mask) {
  int64_t ones = 0;
  for (const uint8_t value : mask.values()) ones += value != 0 ? 1 : 0;
  return mask.empty() ? 0 : static_cast<double>(ones) / static_cast<double>(mask.size());
}

}  // namespace traceflow::prepare
