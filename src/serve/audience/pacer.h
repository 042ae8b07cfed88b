#pragma once

#include <cstdint>

namespace traceflow::serve {

// Time over size, a line fitted to what was measured by least squares in which older measurements count less
// and less.
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

// How coarse a frame is: its sides are those asked for divided by `divisor`.
struct Coarseness {
  double divisor = 1;
  int quality = 90;  // of its JPEG
  bool final = true;
};

struct PacerOptions {
  double moving_seconds = 0.06;    // that a frame may take while the camera moves
  double resting_seconds = 0.3;    // that a step of refining may take, if it need not be the last one
  double carrying_seconds = 0.15;  // that a frame may be on its way to the page
};

// Chooses how coarse one page's frames are, so that they come as fast as they can be made and carried.
class Pacer {
 public:
  explicit Pacer(const PacerOptions& options = {}) : options_(options) {}

  // A frame of so many pixels was rendered and encoded in so many bytes.
  void made(double pixels, double seconds, double bytes);
  // So many bytes were shown by the page, so long after they were sent.
  void carried(double bytes, double seconds);

  // While the camera moves. pixels: of the frame at full size.
  Coarseness moving(double pixels) const;
  // At rest: finer than the frame that is shown now, whose divisor is given (infinity where there is none).
  Coarseness finer(double pixels, double shown_divisor) const;

 private:
  bool fits(double pixels, double seconds) const;

  PacerOptions options_;
  CostLine making_;
  CostLine carrying_;
  double bytes_per_pixel_ = 0.15;
};

}  // namespace traceflow::serve
