#include "splat/sog.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "base/error.h"
#include "files/zip_writer.h"
#include "math/activation.h"
#include "math/spherical_harmonics.h"
#include "splat/gaussians.h"
#include "splat/quantise.h"
#include "splat/webp.h"

namespace traceflow {

namespace {

constexpr int64_t image_side_step = 4, largest_image_side = 16380;
constexpr int64_t palette_columns = 64;  // entries in a row of the palette's image
constexpr int64_t largest_palette = 65536;
constexpr int rotation_tag = 252;  // plus the index of the component that is left out
constexpr int morton_bits = 16;

nlohmann::ordered_json json_array(std::initializer_list<const char*> names) {
  return std::vector<std::string>(names.begin(), names.end());
}

// Not a number becomes 0.
uint8_t rounded_byte(double x) {
  return x > 0 ? static_cast<uint8_t>(std::min(std::round(x), 255.0)) : uint8_t{0};
}

// Sign-preserving log(1 + |x|), and the 16-bit steps in which it is written between the extremes of an axis.
double log_position(double x) { return std::copysign(std::log1p(std::abs(x)), x); }

struct AxisRange {
  double low = INFINITY, high = -INFINITY;
  void include(double x) {
    if (!std::isfinite(x)) return;
    low = std::min(low, x);
    high = std::max(high, x);
  }
  uint32_t steps(double x) const {
    return high > low && std::isfinite(x)
               ? static_cast<uint32_t>(std::lround(65535 * (x - low) / (high - low)))
               : 0;
  }
};

// Interleaves the low bits of three numbers.
uint64_t morton_code(const std::array<uint32_t, 3>& p) {
  uint64_t code = 0;
  for (int bit = morton_bits - 1; bit >= 0; --bit) {
    for (const uint32_t v : p) code = code << 1 | (v >> bit & 1);
  }
  return code;
}

class SogWriter {
 public:
  explicit SogWriter(const Surfels& surfels) : s_(surfels), n_(surfels.count()), steps_(n_), order_(n_) {
    const auto root = static_cast<int64_t>(std::ceil(std::sqrt(static_cast<double>(n_))));
    width_ = padded(root);
    height_ = padded((n_ + width_ - 1) / width_);
    meta_["version"] = 2;
    meta_["asset"] = {{"generator", "TraceFlow"}};
    meta_["count"] = n_;
  }

  std::vector<ZipEntry> entries() {
    write_positions();
    write_rotations();
    write_scales();
    write_colours();
    if (s_.sh.dim(1) > 1) write_harmonics();
    files_.push_back({"meta.json", meta_.dump()});
    return std::move(files_);
  }

 private:
  static int64_t padded(int64_t side) {
    return (side + image_side_step - 1) / image_side_step * image_side_step;
  }
  Tensor<uint8_t> opaque_image() const { return opaque_image(height_, width_); }
  static Tensor<uint8_t> opaque_image(int64_t height, int64_t width) {
    Tensor<uint8_t> image(Shape{height, width, 4});
    for (int64_t i = 3; i < image.size(); i += 4) image[i] = 255;
    return image;
  }
  void add(const char* name, const Tensor<uint8_t>& image) { files_.push_back({name, webp_bytes(image)}); }

  void write_positions() {
    std::array<AxisRange, 3> ranges;
    for (int64_t i = 0; i < n_; ++i) {
      for (size_t a = 0; a < 3; ++a) ranges[a].include(log_position(s_.position.row(i)[a]));
    }
    std::vector<uint64_t> codes(n_);
    for (size_t i = 0; i < codes.size(); ++i) {
      for (size_t a = 0; a < 3; ++a)
        steps_[i][a] = ranges[a].steps(log_position(s_.position.row(static_cast<int64_t>(i))[a]));
      codes[i] = morton_code(steps_[i]);
    }
    std::iota(order_.begin(), order_.end(), int64_t{0});
    std::sort(order_.begin(), order_.end(), [&](int64_t a, int64_t b) {
      const uint64_t x = codes[static_cast<size_t>(a)], y = codes[static_cast<size_t>(b)];
      return x != y ? x < y : a < b;
    });

    Tensor<uint8_t> low = opaque_image(), high = opaque_image();
    for (int64_t p = 0; p < n_; ++p) {
      const auto& steps = steps_[static_cast<size_t>(order_[static_cast<size_t>(p)])];
      for (size_t a = 0; a < 3; ++a) {
        low.data()[4 * p + static_cast<int64_t>(a)] = static_cast<uint8_t>(steps[a] & 0xff);
        high.data()[4 * p + static_cast<int64_t>(a)] = static_cast<uint8_t>(steps[a] >> 8);
      }
    }
    add("means_l.webp", low);
    add("means_u.webp", high);
    nlohmann::ordered_json& means = meta_["means"];
    for (const AxisRange& range : ranges) {
      means["mins"].push_back(range.low);
      means["maxs"].push_back(range.high);
    }
    means["files"] = json_array({"means_l.webp", "means_u.webp"});
  }

  // The three components of the unit quaternion besides its largest one, which is made positive, times √2.
  void write_rotations() {
    Tensor<uint8_t> image = opaque_image();
    for_each_pixel(
        [&](int64_t i, uint8_t* pixel) {
          const float* q = s_.rotation.row(i);
          const double length = std::sqrt(std::inner_product(q, q + 4, q, 0.0));
          const float* largest =
              std::max_element(q, q + 4, [](float a, float b) { return std::abs(a) < std::abs(b); });
          const double factor = std::copysign(std::sqrt(2.0) / (length > 0 ? length : 1), *largest);
          for (const float* c = q; c < q + 4; ++c) {
            if (c != largest) *pixel++ = rounded_byte(255 * (0.5 * factor * *c + 0.5));
          }
          *pixel = static_cast<uint8_t>(rotation_tag + (largest - q));
        },
        image);
    add("quats.webp", image);
    meta_["quats"]["files"] = json_array({"quats.webp"});
  }

  void write_scales() {
    std::vector<float> values;
    for (int64_t i = 0; i < n_; ++i) {
      for (const float v : scales_of(i)) values.push_back(v);
    }
    const Codebook codebook(values);
    Tensor<uint8_t> image = opaque_image();
    for_each_pixel(
        [&](int64_t i, uint8_t* pixel) {
          for (const float v : scales_of(i)) *pixel++ = codebook.index_of(v);
        },
        image);
    add("scales.webp", image);
    meta_["scales"] = {{"codebook", padded_codebook(codebook)}, {"files", json_array({"scales.webp"})}};
  }

  void write_colours() {
    std::vector<float> values;
    for (int64_t i = 0; i < n_; ++i) values.insert(values.end(), s_.sh.row(i), s_.sh.row(i) + 3);
    const Codebook codebook(values);
    Tensor<uint8_t> image = opaque_image();
    for_each_pixel(
        [&](int64_t i, uint8_t* pixel) {
          for (int c = 0; c < 3; ++c) *pixel++ = codebook.index_of(s_.sh.row(i)[c]);
          *pixel = rounded_byte(255 * sigmoid(double{s_.opacity_logit[i]}));
        },
        image);
    add("sh0.webp", image);
    meta_["sh0"] = {{"codebook", padded_codebook(codebook)}, {"files", json_array({"sh0.webp"})}};
  }

  void write_harmonics() {
    const int64_t coefficients = s_.sh.dim(1) - 1;
    Tensor<float> rows(Shape{n_, 3 * coefficients});
    for (int64_t i = 0; i < n_; ++i)
      std::copy(s_.sh.row(i) + 3, s_.sh.row(i) + 3 + 3 * coefficients, rows.row(i));
    const Palette palette = make_palette(rows, largest_palette);
    const int64_t count = palette.entries.dim(0);
    const auto entries = palette.entries.values();
    const Codebook codebook(std::vector<float>(entries.begin(), entries.end()));

    Tensor<uint8_t> image =
        opaque_image((count + palette_columns - 1) / palette_columns, palette_columns * coefficients);
    for (int64_t e = 0; e < count; ++e) {
      uint8_t* pixel = image.row(e / palette_columns) + 4 * coefficients * (e % palette_columns);
      for (int64_t c = 0; c < coefficients; ++c, pixel += 4) {
        for (int64_t channel = 0; channel < 3; ++channel)
          pixel[channel] = codebook.index_of(palette.entries.row(e)[3 * c + channel]);
      }
    }
    Tensor<uint8_t> labels = opaque_image();
    for_each_pixel(
        [&](int64_t i, uint8_t* pixel) {
          const uint16_t label = palette.labels[static_cast<size_t>(i)];
          pixel[0] = static_cast<uint8_t>(label & 0xff);
          pixel[1] = static_cast<uint8_t>(label >> 8);
        },
        labels);
    add("shN_centroids.webp", image);
    add("shN_labels.webp", labels);
    meta_["shN"] = {{"count", count},
                    {"bands", sh_degree(s_.sh.dim(1))},
                    {"codebook", padded_codebook(codebook)},
                    {"files", json_array({"shN_centroids.webp", "shN_labels.webp"})}};
  }

  // Calls f(surfel, its pixel).
  template <class F>
  void for_each_pixel(F&& f, Tensor<uint8_t>& image) const {
    for (int64_t p = 0; p < n_; ++p) f(order_[static_cast<size_t>(p)], image.data() + 4 * p);
  }
  std::array<float, 3> scales_of(int64_t i) const {
    return {s_.log_scale(i, 0), s_.log_scale(i, 1), log_thickness(s_, i)};
  }
  // The format has exactly 256 entries.
  static std::vector<float> padded_codebook(const Codebook& codebook) {
    std::vector<float> entries = codebook.entries();
    entries.resize(256, entries.back());
    return entries;
  }

  const Surfels& s_;
  int64_t n_, width_ = 0, height_ = 0;
  std::vector<std::array<uint32_t, 3>> steps_;  // of each surfel's position
  std::vector<int64_t> order_;                  // the surfel of each pixel
  nlohmann::ordered_json meta_;
  std::vector<ZipEntry> files_;
};

}  // namespace

void write_sog(const std::filesystem::path& path, const Surfels& surfels) {
  if (surfels.count() == 0 || surfels.count() > largest_image_side * largest_image_side) {
    throw InputError(path.string(), "", std::to_string(surfels.count()) + " surfels", "1 to 268,304,400",
                     "export another format");
  }
  write_zip(path, SogWriter(surfels).entries());
}

}  // namespace traceflow
