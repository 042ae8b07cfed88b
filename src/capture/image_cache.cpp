#include "capture/image_cache.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "capture/decode.h"

namespace traceflow {

namespace {

constexpr float int16_unit = 32767;

Tensor<int16_t> narrow(const Tensor<float>& normals) {
  Tensor<int16_t> result;
  result.resize(normals.shape());
  for (int64_t i = 0; i < normals.size(); ++i) {
    result[i] = static_cast<int16_t>(std::lround(std::clamp(normals[i], -1.0F, 1.0F) * int16_unit));
  }
  return result;
}

}  // namespace

ViewTruth ImageCache::load_truth(const std::string& id) const { return decode_truth(source(id), capture_); }

const ViewSource& ImageCache::source(const std::string& id) const {
  const auto found = views_.find(id);
  require(found != views_.end(), "a view belongs to the capture", id);
  return found->second;
}

bool ImageCache::has_mask(const std::string& id) const {
  return given_masks_.contains(id) || source(id).mask;
}

std::optional<DecodedMask> ImageCache::mask(const std::string& id) const {
  if (!has_mask(id)) return std::nullopt;
  const auto given = given_masks_.find(id);
  if (given == given_masks_.end()) return decode_mask(source(id));
  constexpr uint8_t half = 128;
  DecodedMask mask{Tensor<uint8_t>(given->second.shape()), given->second};
  for (int64_t i = 0; i < mask.mask.size(); ++i) mask.mask[i] = mask.coverage[i] >= half ? 1 : 0;
  return mask;
}

Tensor<uint8_t> ImageCache::fine_coverage(const std::string& id, const ViewSource& fine) const {
  const auto given = given_masks_.find(id);
  if (given == given_masks_.end()) return fine.mask ? decode_mask(fine).coverage : Tensor<uint8_t>();
  const Tensor<uint8_t>& coarse = given->second;
  Tensor<uint8_t> result({fine.height(), fine.width()});
  for (int64_t y = 0; y < result.dim(0); ++y) {
    for (int64_t x = 0; x < result.dim(1); ++x)
      result(y, x) = coarse(y * coarse.dim(0) / result.dim(0), x * coarse.dim(1) / result.dim(1));
  }
  return result;
}

void ImageCache::leave_masks_out(std::span<const std::string> ids) {
  for (const std::string& id : ids) {
    views_.at(id).mask = {};
    given_masks_.erase(id);
  }
  empty();
}

void ImageCache::give_masks(std::unordered_map<std::string, Tensor<uint8_t>> coverage) {
  for (const auto& [id, mask] : coverage) {
    const ViewSource& view = source(id);
    require(mask.shape() == Shape{view.height(), view.width()}, "a mask is as large as its view", id);
  }
  given_masks_ = std::move(coverage);
  empty();
}

void ImageCache::empty() {
  by_id_.clear();
  entries_.clear();
  bytes_ = 0;
}

int64_t ImageCache::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

int64_t ImageCache::bytes_of(const std::string& id) const {
  const ViewSource& view = source(id);
  return view.width() * view.height() *
         (3 + (view.transparent_is_unknown ? 1 : 0) + (has_mask(id) ? 2 : 0) + (view.has_prior() ? 6 : 0) +
          (view.depth ? 4 : 0));
}

std::shared_ptr<const ViewPixels> ImageCache::load(const std::string& id) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = by_id_.find(id);
    if (found != by_id_.end()) {
      entries_.splice(entries_.begin(), entries_, found->second);
      return found->second->pixels;
    }
  }
  // Decodes without the lock: two threads may decode the same view, which only costs time.
  auto pixels = std::make_shared<const ViewPixels>(decode(id));
  insert(id, pixels);
  return pixels;
}

ViewPixels ImageCache::decode(const std::string& id) const {
  const ViewSource& view = source(id);
  ViewPixels pixels;
  DecodedColour decoded = decode_colour(view);
  pixels.colour = std::move(decoded.colour);
  pixels.known = std::move(decoded.known);
  if (std::optional<DecodedMask> decoded_mask = mask(id)) {
    pixels.mask = std::move(decoded_mask->mask);
    pixels.coverage = std::move(decoded_mask->coverage);
  }
  if (view.has_prior()) {
    Tensor<float> normals = decode_prior(view, capture_);
    turn_to_world(normals, view, capture_.prior_signs);
    pixels.normal_prior = narrow(normals);
  }
  if (view.depth) pixels.depth_prior = decode_depth(view, capture_);
  return pixels;
}

void ImageCache::insert(const std::string& id, const std::shared_ptr<const ViewPixels>& pixels) {
  const std::lock_guard lock(mutex_);
  const int64_t size = pixels->bytes();
  if (size > limit_bytes_ || by_id_.contains(id)) return;
  while (bytes_ + size > limit_bytes_) {
    bytes_ -= entries_.back().pixels->bytes();
    by_id_.erase(entries_.back().id);
    entries_.pop_back();
  }
  entries_.push_front({id, pixels});
  by_id_[id] = entries_.begin();
  bytes_ += size;
}

std::shared_ptr<const ViewImages> load_images(const Capture& capture, const View& view) {
  auto images = std::make_shared<ViewImages>();
  widen(*load_pixels(capture, view), view.prior_turn, *images);
  return images;
}

FinePhotograph load_fine_photograph(const Capture& capture, const View& view, int64_t widest) {
  ViewSource source = capture.images->source(view.id);
  const auto stored = static_cast<int64_t>(source.lens.width);
  const int64_t factor = std::clamp<int64_t>((stored + widest - 1) / widest, 1, source.factor);
  const auto finer = static_cast<float>(source.factor) / static_cast<float>(factor);
  source.factor = static_cast<int>(factor);
  ViewPixels pixels;
  pixels.colour = decode_colour(source).colour;
  pixels.coverage = capture.images->fine_coverage(view.id, source);
  ViewImages images;
  widen(pixels, std::nullopt, images);
  FinePhotograph photograph{view.camera, std::move(images.colour), std::move(images.coverage)};
  Camera<float>& camera = photograph.camera;
  camera.width = static_cast<int>(source.width());
  camera.height = static_cast<int>(source.height());
  for (float* length : {&camera.focal_x, &camera.focal_y, &camera.centre_x, &camera.centre_y})
    *length *= finer;
  return photograph;
}

void prefetch(const Capture& capture, std::span<const View> views) {
  ImageCache& cache = *capture.images;
  int64_t bytes = 0;
  size_t count = 0;
  while (count < views.size() && (bytes += cache.bytes_of(views[count].id)) <= cache.limit_bytes()) ++count;
  parallel_for(
      "capture: decode", static_cast<int64_t>(count),
      [&](int64_t i) { cache.load(views[static_cast<size_t>(i)].id); }, 1);
}

ViewTruth load_truth(const Capture& capture, const View& view) { return capture.images->load_truth(view.id); }

}  // namespace traceflow
