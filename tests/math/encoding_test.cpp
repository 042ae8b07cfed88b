#include "math/encoding.h"

#include <gtest/gtest.h>

namespace traceflow {
namespace {

TEST(Encoding, HasTheContractsOrder) {
  const double x[2] = {0.3, -1.1};
  double encoding[10];
  ASSERT_EQ(encoding_size(2, 2), 10);
  positional_encoding(x, 2, 2, encoding);
  const double expected[10] = {x[0],
                               x[1],
                               std::sin(x[0]),
                               std::sin(x[1]),
                               std::cos(x[0]),
                               std::cos(x[1]),
                               std::sin(2 * x[0]),
                               std::sin(2 * x[1]),
                               std::cos(2 * x[0]),
                               std::cos(2 * x[1])};
  for (int i = 0; i < 10; ++i) EXPECT_DOUBLE_EQ(encoding[i], expected[i]) << i;
}

TEST(Encoding, OfNoOctavesIsThePoint) {
  const float x[3] = {1, 2, 3};
  float encoding[3];
  positional_encoding(x, 3, 0, encoding);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(encoding[i], x[i]);
}

}  // namespace
}  // namespace traceflow
