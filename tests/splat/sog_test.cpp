#include "splat/sog.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <webp/decode.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "files/zip.h"
#include "math/activation.h"
#include "math/rotation.h"
#include "splat/gaussians.h"
#include "splat/random_surfels.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

struct Image {
  int width = 0, height = 0;
  std::vector<uint8_t> rgba;
  const uint8_t* pixel(int64_t i) const { return rgba.data() + 4 * i; }
};

// A reader written after the format's description.
class SogFile {
 public:
  explicit SogFile(const std::filesystem::path& path) {
    const InputFile file(path);
    for (const ZipMember& member : list_zip(file)) {
      EXPECT_FALSE(member.deflated);
      std::string& bytes = files_[member.name];
      bytes.resize(static_cast<size_t>(member.size));
      file.read_at(member.offset, std::as_writable_bytes(std::span(bytes)));
    }
    meta = nlohmann::json::parse(files_.at("meta.json"));
  }
  Image image(const char* key, size_t i = 0) const {
    const std::string& bytes = files_.at(meta.at(key).at("files").at(i));
    Image result;
    uint8_t* pixels = WebPDecodeRGBA(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size(),
                                     &result.width, &result.height);
    EXPECT_NE(pixels, nullptr);
    result.rgba.assign(pixels, pixels + size_t{4} * static_cast<size_t>(result.width * result.height));
    WebPFree(pixels);
    return result;
  }
  std::vector<float> codebook(const char* key) const { return meta.at(key).at("codebook"); }

  nlohmann::json meta;

 private:
  std::map<std::string, std::string> files_;
};

Tensor<float> positions_of(const SogFile& file) {
  const auto low = file.image("means", 0), high = file.image("means", 1);
  const int64_t n = file.meta.at("count");
  Tensor<float> positions(Shape{n, 3});
  for (int64_t i = 0; i < n; ++i) {
    for (int a = 0; a < 3; ++a) {
      const double lowest = file.meta.at("means").at("mins").at(static_cast<size_t>(a));
      const double highest = file.meta.at("means").at("maxs").at(static_cast<size_t>(a));
      const int steps = low.pixel(i)[a] | high.pixel(i)[a] << 8;
      const double l = lowest + (highest - lowest) * steps / 65535;
      positions(i, a) = static_cast<float>(std::copysign(std::expm1(std::abs(l)), l));
    }
  }
  return positions;
}

// The surfel nearest to each position.
std::vector<int64_t> matches(const Tensor<float>& positions, const Surfels& s) {
  std::vector<int64_t> result;
  for (int64_t p = 0; p < positions.dim(0); ++p) {
    double least = INFINITY;
    int64_t best = 0;
    for (int64_t i = 0; i < s.count(); ++i) {
      double d = 0;
      for (int a = 0; a < 3; ++a) d += std::pow(double{positions(p, a)} - s.position(i, a), 2);
      if (d < least) {
        least = d;
        best = i;
      }
    }
    result.push_back(best);
  }
  return result;
}

// The codebooks' own errors are tested in quantise_test.cpp.
void expect_nearest(const std::vector<float>& codebook, uint8_t index, float wanted) {
  const float error = std::abs(codebook.at(index) - wanted);
  for (const float entry : codebook) EXPECT_LE(error, std::abs(entry - wanted) + 1e-5F);
}

TEST(Sog, AReaderByTheDescriptionFindsTheSurfels) {
  for (const int64_t coefficients : {1, 4, 9, 16}) {
    const Surfels s = random_surfels(500, coefficients, true);
    const TempFolder folder;
    write_sog(folder / "a.sog", s);
    const SogFile file(folder / "a.sog");
    EXPECT_EQ(file.meta.at("version"), 2);
    ASSERT_EQ(file.meta.at("count"), 500);
    const Tensor<float> positions = positions_of(file);
    const std::vector<int64_t> surfel = matches(positions, s);
    EXPECT_EQ(std::set<int64_t>(surfel.begin(), surfel.end()).size(), 500U);

    const Image quats = file.image("quats"), scales = file.image("scales"), sh0 = file.image("sh0");
    const auto scale_codebook = file.codebook("scales"), colour_codebook = file.codebook("sh0");
    EXPECT_EQ(scale_codebook.size(), 256U);
    EXPECT_EQ(quats.width % 4, 0);
    EXPECT_EQ(quats.width, scales.width);
    for (int64_t p = 0; p < 500; ++p) {
      const int64_t i = surfel[static_cast<size_t>(p)];
      for (int a = 0; a < 3; ++a) EXPECT_NEAR(positions(p, a), s.position(i, a), 1e-3);
      const float wanted[] = {s.log_scale(i, 0), s.log_scale(i, 1), log_thickness(s, i)};
      for (int a = 0; a < 3; ++a) expect_nearest(scale_codebook, scales.pixel(p)[a], wanted[a]);
      for (int c = 0; c < 3; ++c) expect_nearest(colour_codebook, sh0.pixel(p)[c], s.sh(i, 0, c));
      EXPECT_NEAR(sh0.pixel(p)[3] / 255.0, sigmoid(s.opacity_logit[i]), 0.5 / 255 + 1e-6);

      Vec4<double> q(0);
      const int left_out = quats.pixel(p)[3] - 252;
      double rest = 1;
      for (int c = 0, next = 0; c < 4; ++c) {
        if (c == left_out) continue;
        q[c] = (quats.pixel(p)[next++] / 255.0 - 0.5) * std::sqrt(2.0);
        rest -= q[c] * q[c];
      }
      q[left_out] = std::sqrt(std::max(0.0, rest));
      const float* r = s.rotation.row(i);
      const Vec4<double> true_q = normalize(Vec4<double>(r[0], r[1], r[2], r[3]));
      EXPECT_GT(std::abs(dot(q, true_q)), 1 - 1e-4);
    }

    EXPECT_EQ(file.meta.contains("shN"), coefficients > 1);
    if (coefficients == 1) continue;
    const auto& rest = file.meta.at("shN");
    EXPECT_EQ(rest.at("bands"), coefficients == 4 ? 1 : coefficients == 9 ? 2 : 3);
    const Image centroids = file.image("shN", 0), labels = file.image("shN", 1);
    EXPECT_EQ(centroids.width, 64 * (coefficients - 1));
    const auto codebook = file.codebook("shN");
    for (int64_t p = 0; p < 500; ++p) {
      const int64_t label = labels.pixel(p)[0] | labels.pixel(p)[1] << 8;
      ASSERT_LT(label, rest.at("count").get<int64_t>());
      for (int64_t k = 1; k < coefficients; ++k) {
        const int64_t column = label % 64 * (coefficients - 1) + k - 1;
        const uint8_t* pixel = centroids.pixel(label / 64 * centroids.width + column);
        for (int c = 0; c < 3; ++c)
          expect_nearest(codebook, pixel[c], s.sh(surfel[static_cast<size_t>(p)], k, c));
      }
    }
  }
}

TEST(Sog, TheSameSurfelsGiveTheSameBytes) {
  const Surfels s = random_surfels(300, 16, true);
  const TempFolder folder;
  write_sog(folder / "a.sog", s);
  write_sog(folder / "b.sog", s);
  EXPECT_EQ(bytes_of(folder / "a.sog"), bytes_of(folder / "b.sog"));
}

TEST(Sog, NumbersThatAreNotFiniteDoNoHarm) {
  Surfels s = random_surfels(5, 4, false);
  s.position(0, 0) = INFINITY;
  s.position(1, 1) = NAN;
  s.rotation(1, 0) = NAN;
  s.log_scale(2, 0) = -INFINITY;
  s.sh(2, 0, 0) = s.sh(2, 1, 0) = NAN;
  s.opacity_logit[3] = NAN;
  const TempFolder folder;
  write_sog(folder / "a.sog", s);
  const Tensor<float> positions = positions_of(SogFile(folder / "a.sog"));
  for (const float v : positions.values()) EXPECT_TRUE(std::isfinite(v));
}

TEST(Sog, OneSurfelIsEnoughAndNoneTooFew) {
  const TempFolder folder;
  const Surfels one = random_surfels(1, 4, false);
  write_sog(folder / "a.sog", one);
  const Tensor<float> positions = positions_of(SogFile(folder / "a.sog"));
  for (int a = 0; a < 3; ++a) EXPECT_NEAR(positions(0, a), one.position(0, a), 1e-5);
  EXPECT_THAT(refusal_of([&] { write_sog(folder / "b.sog", random_surfels(0, 4, false)); }),
              testing::HasSubstr("0 surfels"));
}

}  // namespace
}  // namespace traceflow
