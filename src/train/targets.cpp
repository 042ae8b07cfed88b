#include "train/targets.h"

namespace traceflow {

ViewImages& Targets::of(const Capture& capture, const View& view, bool with_coverage) {
  if (device_ == Device::cpu) {
    widen(*load_pixels(capture, view), view.prior_turn, images_, with_coverage);
  } else {
    widen(on_device(capture, view), view.prior_turn, images_, with_coverage);
  }
  return images_;
}

const ViewPixels& Targets::on_device(const Capture& capture, const View& view) {
  if (const auto found = resident_.find(view.id); found != resident_.end()) return found->second;
  const std::shared_ptr<const ViewPixels> pixels = load_pixels(capture, view);
  if (resident_bytes_ + pixels->bytes() > limit_bytes_) {
    passing_ = pixels->on(device_);
    return passing_;
  }
  resident_bytes_ += pixels->bytes();
  return resident_.emplace(view.id, pixels->on(device_)).first->second;
}

}  // namespace traceflow
