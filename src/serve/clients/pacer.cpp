#include "serve/clients/pacer.h"

#include <algorithm>
#include <array>

namespace traceflow::serve {

namespace {

// Each step about halves the number of pixels.
constexpr std::array<double, 9> divisors = {1, 1.5, 2, 3, 4, 6, 8, 12, 16};
constexpr double keep = 0.9;  // weight of earlier measurements at each new one
constexpr int final_quality = 92;

// A JPEG quality while the camera moves, and the typical size relative to the first.
struct Quality {
  int quality;
  double size;
};
constexpr std::array<Quality, 3> moving_qualities = {{{75, 1}, {60, 0.75}, {45, 0.6}}};
constexpr double final_size = 2;
double relative_size(int quality) {
  for (const Quality& q : moving_qualities) {
    if (quality >= q.quality) return quality >= final_quality ? final_size : q.size;
  }
  return moving_qualities.back().size;
}

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
  // With measurements of only one size, time is taken as proportional to size.
  if (!(spread > 1e-3 * mean_size * mean_size)) return mean_size > 0 ? mean_seconds * size / mean_size : 0;
  const double slope = std::max(0.0, (size_seconds_ / weight_ - mean_size * mean_seconds) / spread);
  const double fixed = mean_seconds - slope * mean_size;
  // Noise can give the line a negative intercept. The line then goes through the origin.
  return fixed >= 0 ? fixed + slope * size : mean_seconds * size / mean_size;
}

void Pacer::rendered(double pixels, double seconds, double bytes, int quality) {
  rendering_cost_.add(pixels, seconds);
  if (pixels > 0) bytes_per_pixel_ += 0.2 * (bytes / pixels / relative_size(quality) - bytes_per_pixel_);
}

void Pacer::displayed(double bytes, double seconds) { transfer_cost_.add(bytes, seconds); }

bool Pacer::can_be_transferred(double pixels, double relative_size) const {
  return transfer_cost_.seconds(pixels * bytes_per_pixel_ * relative_size) <= options_.transfer_seconds;
}

Coarseness Pacer::moving(double pixels) const {
  // The first frame measures the cost, so it should be cheap.
  if (!rendering_cost_.is_known()) return {4, moving_qualities.front().quality, false};
  for (const double divisor : divisors) {
    const double rendered = pixels / (divisor * divisor);
    if (rendering_cost_.seconds(rendered) > options_.moving_seconds) continue;
    for (const Quality& q : moving_qualities) {
      if (can_be_transferred(rendered, q.size)) return {divisor, q.quality, false};
    }
  }
  return {divisors.back(), moving_qualities.back().quality, false};
}

Coarseness Pacer::finer(double pixels, double shown_divisor) const {
  if (!rendering_cost_.is_known()) return moving(pixels);
  for (const double divisor : divisors) {
    if (divisor >= shown_divisor) break;
    const double rendered = pixels / (divisor * divisor);
    if (rendering_cost_.seconds(rendered) <= options_.resting_seconds &&
        can_be_transferred(rendered, final_size))
      return {divisor, final_quality, divisor == 1};
  }
  // If no divisor fits, each step at least halves the divisor, so that refinement ends.
  if (shown_divisor <= 2) return full();
  const Coarseness first = moving(pixels);
  return {std::min(first.divisor, shown_divisor / 2), final_quality, false};
}

Coarseness Pacer::full() { return {1, final_quality, true}; }

}  // namespace traceflow::serve
