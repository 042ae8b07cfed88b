#include "serve/audience/pacer.h"

#include <algorithm>
#include <array>

namespace traceflow::serve {

namespace {

// Each has about half the pixels of the one before.
constexpr std::array<double, 9> divisors = {1, 1.5, 2, 3, 4, 6, 8, 12, 16};
constexpr double keep = 0.9;  // weight of the past at each new measurement
constexpr int moving_quality = 75, final_quality = 92;

}  // namespace

void CostLine::add(double size, double seconds) {
  weight_ = keep * weight_ + 1;
  size_ = keep * size_ + size;
  seconds_ = keep * seconds_ + seconds;
  size_size_ = keep * size_size_ + size * size;
  size_seconds_ = keep * size_seconds_ + size * seconds;
}

double CostLine::seconds(double size) const {
  if (weight_ <= 0) return 0;
  const double mean_size = size_ / weight_, mean_seconds = seconds_ / weight_;
  const double spread = size_size_ / weight_ - mean_size * mean_size;
  // All of one size so far: the time goes with the size, as far as anybody can tell.
  if (!(spread > 1e-3 * mean_size * mean_size)) return mean_size > 0 ? mean_seconds * size / mean_size : 0;
  const double slope = std::max(0.0, (size_seconds_ / weight_ - mean_size * mean_seconds) / spread);
  const double fixed = mean_seconds - slope * mean_size;
  // Noise can tilt the line until small frames cost less than nothing; then it goes through the origin.
  return fixed >= 0 ? fixed + slope * size : mean_seconds * size / mean_size;
}

void Pacer::made(double pixels, double seconds, double bytes) {
  making_.add(pixels, seconds);
  if (pixels > 0) bytes_per_pixel_ += 0.2 * (bytes / pixels - bytes_per_pixel_);
}

void Pacer::carried(double bytes, double seconds) { carrying_.add(bytes, seconds); }

bool Pacer::fits(double pixels, double seconds) const {
  return making_.seconds(pixels) <= seconds &&
         carrying_.seconds(pixels * bytes_per_pixel_) <= options_.carrying_seconds;
}

Coarseness Pacer::moving(double pixels) const {
  // The first frame of all tells what a frame costs; it had better be cheap.
  if (!making_.is_known()) return {4, moving_quality, false};
  for (const double divisor : divisors) {
    if (fits(pixels / (divisor * divisor), options_.moving_seconds)) return {divisor, moving_quality, false};
  }
  return {divisors.back(), moving_quality, false};
}

Coarseness Pacer::finer(double pixels, double shown_divisor) const {
  if (!making_.is_known()) return moving(pixels);
  for (const double divisor : divisors) {
    if (divisor >= shown_divisor) break;
    if (fits(pixels / (divisor * divisor), options_.resting_seconds))
      return {divisor, final_quality, divisor == 1};
  }
  // Nothing fits: at least twice as fine in every step, so that the last one comes at some time.
  if (shown_divisor <= 2) return {1, final_quality, true};
  const Coarseness first = moving(pixels);
  return {std::min(first.divisor, shown_divisor / 2), final_quality, false};
}

}  // namespace traceflow::serve
