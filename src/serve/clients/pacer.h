#pragma once

#include <cstdint>

namespace traceflow::serve {

// Time as a linear function of size, fitted by least squares with exponentially decaying weights.
class CostLine {
 public:
  // size: pixels or bytes.
  void add(double size, double seconds);
  bool is_known() const { return weight_ > 0; }
  // At least 0; 0 before the first measurement.
  double seconds(double size) const;

 private:
  double weight_ = 0, size_ = 0, seconds_ = 0, size_size_ = 0, size_seconds_ = 0;
};

// The resolution and quality of a frame: its sides are the requested ones divided by `divisor`.
struct Coarseness {
  double divisor = 1;
  int quality = 90;  // JPEG quality
  bool final = true;
};

struct PacerOptions {
  double moving_seconds = 0.06;    // to render a frame while the camera moves
  double resting_seconds = 0.3;    // for a refining step except the last one
  double transfer_seconds = 0.15;  // to transfer a frame to the page
};

// Chooses the resolution of one page's frames by how fast frames are rendered and transferred.
class Pacer {
 public:
  explicit Pacer(const PacerOptions& options = {}) : options_(options) {}

  // Records a frame that was rendered and encoded.
  void rendered(double pixels, double seconds, double bytes, int quality);
  // Records that the page displayed a frame of `bytes` `seconds` after it was sent.
  void displayed(double bytes, double seconds);

  // While the camera moves. pixels: of the frame at full size.
  Coarseness moving(double pixels) const;
  // At rest: finer than the displayed frame, whose divisor is given (infinity if there is none).
  Coarseness finer(double pixels, double shown_divisor) const;
  // The last refining step: full resolution.
  static Coarseness full();

 private:
  bool can_be_transferred(double pixels, double relative_size) const;

  PacerOptions options_;
  CostLine rendering_cost_;
  CostLine transfer_cost_;
  double bytes_per_pixel_ = 0.15;  // at the quality of moving frames on a fast connection
};

}  // namespace traceflow::serve
