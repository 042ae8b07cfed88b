#include "splat/quantise.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"

namespace traceflow {

namespace {

constexpr size_t codebook_size = 256;
constexpr size_t histogram_bins = 4096;
constexpr int lloyd_iterations = 32;

// Numbers with a density proportional to the cube root of that of the sorted values, which is the best one of
// many levels (Panter and Dite 1951). Lloyd's algorithm alone approaches it too slowly.
std::vector<float> first_entries(const std::vector<float>& values) {
  const double low = values.front(), width = (double{values.back()} - low) / histogram_bins;
  std::vector<double> density(histogram_bins);
  for (const float v : values)
    ++density[std::min(histogram_bins - 1, static_cast<size_t>(std::max(0.0, (v - low) / width)))];
  double sum = 0;
  for (double& d : density) sum += d = std::cbrt(d);
  std::vector<float> entries;
  double below = 0;
  for (size_t bin = 0; bin < histogram_bins; ++bin) {
    const auto place = [&](size_t k) { return (static_cast<double>(k) + 0.5) / codebook_size * sum; };
    while (entries.size() < codebook_size && place(entries.size()) <= below + density[bin]) {
      const double within = (place(entries.size()) - below) / density[bin];
      entries.push_back(static_cast<float>(low + width * (static_cast<double>(bin) + within)));
    }
    below += density[bin];
  }
  entries.resize(codebook_size, values.back());
  return entries;
}

class MedianCut {
 public:
  MedianCut(const Tensor<float>& rows, Palette& palette)
      : rows_(rows), palette_(palette), order_(rows.dim(0)) {
    std::iota(order_.begin(), order_.end(), int64_t{0});
  }

  // Makes `count` entries, from entry `first`, of the rows order_[begin … end).
  void split(size_t begin, size_t end, int64_t first, int64_t count) {
    if (count == 1) return make_entry(begin, end, first);
    const int64_t axis = widest_axis(begin, end);
    const size_t middle = begin + (end - begin) / 2;
    const auto at = [&](size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end), [&](int64_t a, int64_t b) {
      const float x = rows_.row(a)[axis], y = rows_.row(b)[axis];
      return x != y ? x < y : a < b;
    });
    split(begin, middle, first, count / 2);
    split(middle, end, first + count / 2, count / 2);
  }

 private:
  std::vector<double> mean(size_t begin, size_t end) const {
    std::vector<double> mean(static_cast<size_t>(rows_.row_size()));
    for (size_t i = begin; i < end; ++i) {
      const float* row = rows_.row(order_[i]);
      for (size_t d = 0; d < mean.size(); ++d) mean[d] += row[d];
    }
    for (double& m : mean) m /= static_cast<double>(end - begin);
    return mean;
  }
  int64_t widest_axis(size_t begin, size_t end) const {
    const std::vector<double> middle = mean(begin, end);
    std::vector<double> variance(middle.size());
    for (size_t i = begin; i < end; ++i) {
      const float* row = rows_.row(order_[i]);
      for (size_t d = 0; d < middle.size(); ++d) variance[d] += (row[d] - middle[d]) * (row[d] - middle[d]);
    }
    return std::max_element(variance.begin(), variance.end()) - variance.begin();
  }
  void make_entry(size_t begin, size_t end, int64_t entry) {
    const std::vector<double> middle = mean(begin, end);
    std::transform(middle.begin(), middle.end(), palette_.entries.row(entry),
                   [](double v) { return static_cast<float>(v); });
    for (size_t i = begin; i < end; ++i)
      palette_.labels[static_cast<size_t>(order_[i])] = static_cast<uint16_t>(entry);
  }

  const Tensor<float>& rows_;
  Palette& palette_;
  std::vector<int64_t> order_;
};

}  // namespace

Codebook::Codebook(std::vector<float> values) {
  std::erase_if(values, [](float v) { return !std::isfinite(v); });
  std::sort(values.begin(), values.end());
  std::vector<float> different = values;
  different.erase(std::unique(different.begin(), different.end()), different.end());
  if (different.size() <= codebook_size) {
    entries_ = different.empty() ? std::vector<float>{0} : different;
    return;
  }
  std::vector<double> sums(values.size() + 1);
  for (size_t i = 0; i < values.size(); ++i) sums[i + 1] = sums[i] + values[i];
  entries_ = first_entries(values);
  for (int iteration = 0; iteration < lloyd_iterations; ++iteration) {
    size_t begin = 0;
    for (size_t k = 0; k < codebook_size; ++k) {
      const float border = k + 1 < codebook_size ? 0.5F * (entries_[k] + entries_[k + 1]) : INFINITY;
      const auto end = static_cast<size_t>(
          std::upper_bound(values.begin() + static_cast<std::ptrdiff_t>(begin), values.end(), border) -
          values.begin());
      if (end > begin)
        entries_[k] = static_cast<float>((sums[end] - sums[begin]) / static_cast<double>(end - begin));
      begin = end;
    }
  }
}

uint8_t Codebook::index_of(float value) const {
  // Not a number is as good as the smallest.
  if (!(value > entries_.front())) return 0;
  const auto above = std::lower_bound(entries_.begin(), entries_.end(), value);
  const auto k = above - entries_.begin();
  if (above == entries_.end()) return static_cast<uint8_t>(k - 1);
  return static_cast<uint8_t>(value - *(above - 1) < *above - value ? k - 1 : k);
}

Palette make_palette(const Tensor<float>& rows, int64_t most) {
  require(most >= 1 && most <= 65536 && (most & (most - 1)) == 0, "a power of two up to 65,536",
          std::to_string(most));
  Palette palette;
  palette.labels.resize(static_cast<size_t>(rows.dim(0)));
  if (rows.dim(0) <= most) {
    palette.entries = rows;
    std::iota(palette.labels.begin(), palette.labels.end(), uint16_t{0});
    return palette;
  }
  palette.entries = Tensor<float>(Shape{most, rows.row_size()});
  MedianCut(rows, palette).split(0, static_cast<size_t>(rows.dim(0)), 0, most);
  return palette;
}

}  // namespace traceflow
