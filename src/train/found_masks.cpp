#include "train/found_masks.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/atomic_file.h"
#include "base/parallel.h"
#include "capture/image_cache.h"
#include "files/png.h"
#include "track/mask_parts.h"
#include "train/box_mean.h"
#include "train/initialise.h"
#include "train/random_walk.h"

namespace traceflow {

namespace {

constexpr int widest = 160;  // pixels
constexpr int least_iterations = 200;
constexpr int least_views = 10;
constexpr float moves_above = 0.4F;

float ramp(float value, float from, float to) { return std::clamp((value - from) / (to - from), 0.0F, 1.0F); }

// Applies f to each pixel index.
template <class F>
Tensor<float> per_pixel(int64_t height, int64_t width, F&& f) {
  Tensor<float> result({height, width});
  for (int64_t i = 0; i < result.size(); ++i) result[i] = f(i);
  return result;
}

// The difference of a photograph from the static scene after correcting brightness, since a shadow is not an
// object. It is the larger of the mean difference over squares and a multiple of its root mean square.
Tensor<float> difference(const Tensor<float>& still, const Tensor<float>& photograph) {
  constexpr int64_t half_window = 2;
  constexpr float darkest = 0.55F, brightest = 1.25F, rough = 0.6F;
  const int64_t height = still.dim(0), width = still.dim(1);
  const auto mean_of = [&](auto&& f, int64_t to_each_side) {
    return box_mean(per_pixel(height, width, f), to_each_side);
  };
  const auto at = [](const Tensor<float>& image, int64_t i) { return load3<float>(&image[3 * i]); };
  const Tensor<float> size = mean_of([&](int64_t i) { return dot(at(still, i), at(still, i)); }, half_window);
  const Tensor<float> both =
      mean_of([&](int64_t i) { return dot(at(still, i), at(photograph, i)); }, half_window);
  Tensor<float> off({height, width, 3});
  for (int64_t i = 0; i < size.size(); ++i) {
    const float brightness = std::clamp(both[i] / std::max(size[i], 1e-6F), darkest, brightest);
    store3(&off[3 * i], brightness * at(still, i) - at(photograph, i));
  }
  const Tensor<float> square =
      mean_of([&](int64_t i) { return dot(at(off, i), at(off, i)) / 3; }, half_window);
  Tensor<float> result = per_pixel(height, width, [&](int64_t i) { return rough * std::sqrt(square[i]); });
  for (int64_t c = 0; c < 3; ++c) {
    const Tensor<float> mean = mean_of([&](int64_t i) { return off[3 * i + c]; }, 1);
    for (int64_t i = 0; i < mean.size(); ++i) result[i] = std::max(result[i], std::abs(mean[i]));
  }
  return result;
}

// The similarity of two pixels, from their normals and colours. Colours have a higher weight without normals.
float likeness(const ViewImages& photograph, int64_t i, int64_t j) {
  constexpr float steep = 60, least = 1e-4F, colour_weight = 1, colour_alone = 9, normal_weight = 9;
  const Vec3<float> colour =
      load3<float>(&photograph.colour[3 * i]) - load3<float>(&photograph.colour[3 * j]);
  if (photograph.normal_prior.empty()) return std::exp(-steep * colour_alone * dot(colour, colour)) + least;
  const Vec3<float> normal =
      load3<float>(&photograph.normal_prior[3 * i]) - load3<float>(&photograph.normal_prior[3 * j]);
  return std::exp(-steep * (colour_weight * dot(colour, colour) + normal_weight * dot(normal, normal))) +
         least;
}

// The share of each pixel of a view with values above the threshold. The coarser image is interpolated.
Tensor<uint8_t> coverage_above(const Tensor<float>& coarse, float threshold, int64_t height, int64_t width,
                               float factor) {
  constexpr int64_t samples = 4;  // along each side of a pixel
  const auto read = [&](float y, float x) {
    const float row = std::clamp(y - 0.5F, 0.0F, static_cast<float>(coarse.dim(0) - 1));
    const float column = std::clamp(x - 0.5F, 0.0F, static_cast<float>(coarse.dim(1) - 1));
    const auto top = static_cast<int64_t>(row), left = static_cast<int64_t>(column);
    const int64_t bottom = std::min(top + 1, coarse.dim(0) - 1),
                  right = std::min(left + 1, coarse.dim(1) - 1);
    const float v = row - static_cast<float>(top), u = column - static_cast<float>(left);
    return (1 - v) * ((1 - u) * coarse(top, left) + u * coarse(top, right)) +
           v * ((1 - u) * coarse(bottom, left) + u * coarse(bottom, right));
  };
  Tensor<uint8_t> coverage({height, width});
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) {
      int64_t inside = 0;
      for (int64_t k = 0; k < samples * samples; ++k) {
        const auto within = [](int64_t n) { return (static_cast<float>(n) + 0.5F) / samples; };
        const float row = (static_cast<float>(y) + within(k / samples)) / factor;
        const float column = (static_cast<float>(x) + within(k % samples)) / factor;
        inside += read(row, column) > threshold ? 1 : 0;
      }
      coverage(y, x) = static_cast<uint8_t>(255 * inside / (samples * samples));
    }
  }
  return coverage;
}

// Removes parts that are too small to be tracked.
void leave_out_specks(Tensor<float>& share) {
  constexpr double least = 0.005;  // of the image
  Tensor<uint8_t> mask(share.shape());
  for (int64_t i = 0; i < mask.size(); ++i) mask[i] = share[i] > moves_above ? 1 : 0;
  for (const std::vector<int64_t>& part : mask_parts(mask)) {
    if (static_cast<double>(part.size()) >= least * static_cast<double>(mask.size())) continue;
    for (const int64_t pixel : part) share[pixel] = 0;
  }
}

bool has_object_mask(const Capture& capture, const View& view) {
  return !capture.masks_are_estimated && capture.images->has_mask(view.id);
}

// Whether a view of the first frame has a mask of the objects.
bool shows_first_objects(const Capture& capture) {
  const auto earlier = [](const View& a, const View& b) { return a.time < b.time; };
  const auto first = std::min_element(capture.train.begin(), capture.train.end(), earlier);
  return std::any_of(capture.train.begin(), capture.train.end(), [&](const View& view) {
    return view.time == first->time && has_object_mask(capture, view);
  });
}

std::filesystem::path picture_of(const std::filesystem::path& folder, const std::string& id) {
  return folder / (id + ".png");
}

}  // namespace

int iterations_to_find_objects(const Capture& capture, const TrainOptions& options) {
  if (shows_first_objects(capture) || !options.deform.main || options.deform.kind != "nodes") return 0;
  const int iterations = std::min(options.deform.find, options.iterations / 5 * 2);
  const bool is_too_short = iterations < least_iterations || capture.train.size() < least_views;
  return is_too_short ? 0 : iterations;
}

Tensor<float> moving_share(const StillScene::Look& still, const ViewImages& photograph) {
  // Evidence counts where most photographs agree with the static scene. Where the scene is always hidden, it
  // is unknown.
  constexpr float known_from = 0.6F, known_to = 0.9F;
  constexpr float same_to = 0.02F, undecided = 0.05F, differs_from = 0.13F;
  constexpr float weight = 0.3F, doubt = 2e-4F;
  const Tensor<float> off = difference(still.colour, photograph.colour);
  const Tensor<float> agreement = box_mean(still.agreement, 1);
  const int64_t height = off.dim(0), width = off.dim(1);
  WalkTerms terms{Tensor<float>(off.shape()), Tensor<float>(off.shape()), Tensor<float>(off.shape()),
                  Tensor<float>(off.shape())};
  for (int64_t i = 0; i < off.size(); ++i) {
    const bool says_something = photograph.known.empty() || photograph.known[i] != 0;
    const float known = says_something ? weight * ramp(agreement[i], known_from, known_to) : 0;
    terms.one[i] = known * ramp(off[i], undecided, differs_from) + doubt;
    terms.zero[i] = known * ramp(-off[i], -undecided, -same_to) + doubt;
    if (i % width + 1 < width) terms.right[i] = likeness(photograph, i, i + 1);
    if (i / width + 1 < height) terms.down[i] = likeness(photograph, i, i + width);
  }
  return random_walk(terms);
}

std::optional<FoundObjects> find_objects(const Capture& capture, const TrainOptions& options, int iterations,
                                         const StepsDone& progress) {
  const int width = capture.train.front().camera.width;
  const int factor = (width + widest - 1) / widest;
  TrainOptions small = options;
  small.capture.downscale *= factor;
  const Capture film = load_capture(capture.folder, small.capture);
  require(film.train.size() == capture.train.size(), "a capture has the same views at any size", "");
  bool stopped = false;
  StillScene still(film, small, iterations, [&](int64_t done, int64_t all) {
    stopped = !progress(done, all);
    return !stopped;
  });
  if (stopped) return std::nullopt;
  std::vector<StillScene::Look> looks;
  for (const View& view : film.train) looks.push_back(still.look(view));
  std::vector<Tensor<uint8_t>> covers(film.train.size());
  parallel_for(
      "found masks: walk", static_cast<int64_t>(covers.size()),
      [&](int64_t k) {
        const auto at = static_cast<size_t>(k);
        const Camera<float>& camera = capture.train[at].camera;
        Tensor<float> share = moving_share(looks[at], *load_images(film, film.train[at]));
        leave_out_specks(share);
        covers[at] =
            coverage_above(share, moves_above, camera.height, camera.width, static_cast<float>(factor));
      },
      1);
  FoundObjects found;
  for (size_t k = 0; k < covers.size(); ++k) {
    const View& view = capture.train[k];
    if (!has_object_mask(capture, view)) found.masks.emplace(view.id, std::move(covers[k]));
  }
  found.standing_points = still.standing(finite_points(capture.points));
  return found;
}

double covered_share(const FoundMasks& masks) {
  int64_t sum = 0, most = 0;
  for (const auto& [id, mask] : masks) {
    sum = std::accumulate(mask.values().begin(), mask.values().end(), sum);
    most += 255 * mask.size();
  }
  return most > 0 ? static_cast<double>(sum) / static_cast<double>(most) : 0;
}

void give_objects(const FoundObjects& found, Capture& capture) {
  const bool has_others = std::any_of(capture.train.begin(), capture.train.end(), [&](const View& view) {
    return has_object_mask(capture, view) && !found.masks.contains(view.id);
  });
  capture.masks_are_found = !has_others;
  capture.images->give_masks(found.masks);
  capture.found_masks = static_cast<int64_t>(found.masks.size());
  capture.standing_points = found.standing_points;
}

void write_masks(const FoundMasks& masks, const std::filesystem::path& folder) {
  for (const auto& [id, mask] : masks) {
    const std::filesystem::path path = picture_of(folder, id);
    make_folder(path.parent_path());
    write_png(path, mask);
  }
}

FoundMasks read_masks(const std::filesystem::path& folder, const Capture& capture) {
  FoundMasks masks;
  for (const View& view : capture.train) {
    const std::filesystem::path path = picture_of(folder, view.id);
    if (!std::filesystem::exists(path)) continue;
    Tensor<uint8_t> mask = read_png(path);
    const Shape wanted{view.camera.height, view.camera.width};
    if (mask.shape() != Shape{wanted[0], wanted[1], 1})
      throw InputError(path.string(), "size", mask.shape().to_string(), wanted.to_string(),
                       "put the run's masks back, or begin again");
    mask.resize(wanted);
    masks.emplace(view.id, std::move(mask));
  }
  return masks;
}

}  // namespace traceflow
