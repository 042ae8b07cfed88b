#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>

#include "capture/capture.h"
#include "capture/decode.h"
#include "capture/pixels.h"
#include "capture/view_source.h"

namespace traceflow {

// Cache of decoded views that drops the least recently used first. Safe to use from several threads.
class ImageCache {
 public:
  ImageCache(std::unordered_map<std::string, ViewSource> views, CaptureSource capture, int64_t limit_bytes)
      : views_(std::move(views)), capture_(std::move(capture)), limit_bytes_(limit_bytes) {}

  std::shared_ptr<const ViewPixels> load(const std::string& id);
  ViewTruth load_truth(const std::string& id) const;
  // Throws InternalError if the view is not in this capture.
  const ViewSource& source(const std::string& id) const;
  bool has_mask(const std::string& id) const;
  // A view's mask, or nothing if it has none.
  std::optional<DecodedMask> mask(const std::string& id) const;
  // The coverage of the view's mask on a finer grid. `fine` is source(id) with a lower factor. Empty if the
  // view has no mask.
  Tensor<uint8_t> fine_coverage(const std::string& id, const ViewSource& fine) const;
  // Empties the cache and removes the masks of these views. Must not run during other calls.
  void leave_masks_out(std::span<const std::string> ids);
  // Empties the cache and replaces the masks of these views: H×W like the views, 255 if the mask covers the
  // whole pixel. Must not run during other calls.
  void give_masks(std::unordered_map<std::string, Tensor<uint8_t>> coverage);
  const CaptureSource& capture() const { return capture_; }
  int64_t bytes() const;
  int64_t limit_bytes() const { return limit_bytes_; }
  // Bytes of a view in the cache, computed from its size.
  int64_t bytes_of(const std::string& id) const;

 private:
  struct Entry {
    std::string id;
    std::shared_ptr<const ViewPixels> pixels;
  };
  ViewPixels decode(const std::string& id) const;
  void empty();
  void insert(const std::string& id, const std::shared_ptr<const ViewPixels>& pixels);

  std::unordered_map<std::string, ViewSource> views_;
  std::unordered_map<std::string, Tensor<uint8_t>> given_masks_;
  const CaptureSource capture_;
  const int64_t limit_bytes_;

  mutable std::mutex mutex_;
  std::list<Entry> entries_;  // most recently used first
  std::unordered_map<std::string, std::list<Entry>::iterator> by_id_;
  int64_t bytes_ = 0;
};

}  // namespace traceflow
