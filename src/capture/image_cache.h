#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>

#include "capture/capture.h"
#include "capture/view_source.h"

namespace traceflow {

// Decoded views, the least recently used dropped first. Kept small (8-bit colours, 16-bit normals) and
// widened when asked for. Safe to use from several threads.
class ImageCache {
 public:
  ImageCache(std::unordered_map<std::string, ViewSource> views, CaptureSource capture, int64_t limit_bytes)
      : views_(std::move(views)), capture_(std::move(capture)), limit_bytes_(limit_bytes) {}

  std::shared_ptr<const ViewImages> load(const std::string& id);
  ViewTruth load_truth(const std::string& id) const;
  // Decodes a view into the cache unless it is there.
  void warm(const std::string& id);

  // Throws InternalError for a view of another capture.
  const ViewSource& source(const std::string& id) const;
  const CaptureSource& capture() const { return capture_; }
  int64_t bytes() const;
  int64_t limit_bytes() const { return limit_bytes_; }
  // What a view takes in the cache, from its size alone.
  int64_t bytes_of(const std::string& id) const;

 private:
  struct Pixels {
    Tensor<uint8_t> colour, mask;
    Tensor<int16_t> normal_prior;
    int64_t bytes() const { return colour.size() + mask.size() + 2 * normal_prior.size(); }
  };
  struct Entry {
    std::string id;
    std::shared_ptr<const Pixels> pixels;
  };
  std::shared_ptr<const Pixels> find_or_decode(const std::string& id);
  Pixels decode(const std::string& id) const;
  void insert(const std::string& id, const std::shared_ptr<const Pixels>& pixels);

  const std::unordered_map<std::string, ViewSource> views_;
  const CaptureSource capture_;
  const int64_t limit_bytes_;

  mutable std::mutex mutex_;
  std::list<Entry> entries_;  // most recently used first
  std::unordered_map<std::string, std::list<Entry>::iterator> by_id_;
  int64_t bytes_ = 0;
};

}  // namespace traceflow
