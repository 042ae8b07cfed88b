#include "splat/quantise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace traceflow {
namespace {

double squared_error(const Codebook& codebook, const std::vector<float>& values) {
  double sum = 0;
  for (const float v : values) sum += std::pow(codebook.entries()[codebook.index_of(v)] - v, 2);
  return sum / static_cast<double>(values.size());
}

TEST(Codebook, KeepsUpTo256DifferentNumbersExactly) {
  std::vector<float> values;
  for (int i = 0; i < 256; ++i) values.push_back(std::exp(0.1F * static_cast<float>(i)));
  for (int i = 0; i < 256; ++i) values.push_back(values[static_cast<size_t>(i)]);
  EXPECT_EQ(squared_error(Codebook(values), values), 0);
}

TEST(Codebook, FindsTheNearestEntry) {
  Random random(5);
  std::vector<float> values;
  for (int i = 0; i < 5000; ++i) values.push_back(static_cast<float>(random.normal()));
  const Codebook codebook(values);
  ASSERT_EQ(codebook.entries().size(), 256U);
  EXPECT_TRUE(std::is_sorted(codebook.entries().begin(), codebook.entries().end()));
  for (int i = 0; i < 500; ++i) {
    const auto v = static_cast<float>(3 * random.normal());
    const float found = std::abs(codebook.entries()[codebook.index_of(v)] - v);
    for (const float e : codebook.entries()) EXPECT_LE(found, std::abs(e - v));
  }
}

// Oracle: Panter and Dite's error of the best quantiser of many levels, for the normal distribution √3 π/2 ·
// σ²/L².
TEST(Codebook, ComesNearTheLeastPossibleError) {
  Random random(5);
  std::vector<float> values;
  for (int i = 0; i < 100000; ++i) values.push_back(static_cast<float>(random.normal()));
  const double least = std::sqrt(3.0) * M_PI / 2 / (256.0 * 256.0);
  EXPECT_LT(squared_error(Codebook(values), values), 1.5 * least);
}

TEST(Codebook, LeavesOutNumbersThatAreNotFinite) {
  const Codebook codebook({NAN, INFINITY, -INFINITY, 2, 3});
  EXPECT_EQ(codebook.entries(), (std::vector<float>{2, 3}));
  EXPECT_EQ(codebook.index_of(NAN), 0);
  EXPECT_EQ(codebook.index_of(INFINITY), 1);
  EXPECT_EQ(Codebook({NAN}).entries().size(), 1U);
}

Tensor<float> clustered_rows(int64_t n, int64_t clusters, double spread) {
  Random random(11);
  Tensor<float> centres(Shape{clusters, 6}), rows(Shape{n, 6});
  for (float& v : centres.values()) v = static_cast<float>(10 * random.normal());
  for (int64_t i = 0; i < n; ++i) {
    for (int64_t d = 0; d < 6; ++d)
      rows(i, d) = centres(i % clusters, d) + static_cast<float>(spread * random.normal());
  }
  return rows;
}

TEST(Palette, HasARowOfItsOwnForEachOfFew) {
  const Tensor<float> rows = clustered_rows(64, 8, 1);
  const Palette palette = make_palette(rows, 64);
  for (int64_t i = 0; i < 64; ++i) {
    const float* entry = palette.entries.row(palette.labels[static_cast<size_t>(i)]);
    EXPECT_TRUE(std::equal(entry, entry + 6, rows.row(i)));
  }
}

// Oracle: as many groups as clusters of the same size explain all but the spread within them.
TEST(Palette, FindsClusters) {
  const Tensor<float> rows = clustered_rows(4096, 16, 0.01);
  const Palette palette = make_palette(rows, 256);
  ASSERT_EQ(palette.entries.dim(0), 256);
  double worst = 0;
  std::vector<int> used(256);
  for (int64_t i = 0; i < rows.dim(0); ++i) {
    const uint16_t label = palette.labels[static_cast<size_t>(i)];
    ++used.at(label);
    for (int64_t d = 0; d < 6; ++d)
      worst = std::max(worst, std::abs(double{rows(i, d)} - palette.entries(label, d)));
  }
  EXPECT_LT(worst, 0.1);
  EXPECT_EQ(*std::min_element(used.begin(), used.end()), 16);
}

}  // namespace
}  // namespace traceflow
