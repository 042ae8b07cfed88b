#include "ops/loss/rigidity.h"

#include <limits>

#include "support/gradients.h"
#include "support/loss_values.h"

namespace traceflow::loss {
namespace {

using namespace traceflow::testing;

constexpr double strain = 0.2;

struct Cloud {
  Tensor<double> rest, posed;
  std::vector<int32_t> subset;
  Neighbours edges;
};

// Points in a box, every other one posed a little elsewhere; as a subset when some are left out.
Cloud make_cloud(int64_t count, bool leave_some_out) {
  Random random(5);
  Cloud c;
  c.rest = random_tensor<double>({count, 3}, random, -1, 1);
  c.edges = spread_neighbours(convert<float>(c.rest), 4, 2);
  for (int64_t i = 0; i < count; ++i) {
    if (!leave_some_out || i % 3 != 0) c.subset.push_back(static_cast<int32_t>(i));
  }
  c.posed.reset({static_cast<int64_t>(c.subset.size()), 3});
  for (int64_t i = 0; i < c.posed.dim(0); ++i) {
    for (int64_t k = 0; k < 3; ++k) {
      c.posed(i, k) = c.rest(c.subset[static_cast<size_t>(i)], k) + random.uniform(-0.2, 0.2);
    }
  }
  if (!leave_some_out) c.subset.clear();
  return c;
}

struct Gradients {
  double value = 0;
  Tensor<double> rest, posed;
};

Gradients reference(const Cloud& c, double weight = 1) {
  Gradients g{0, Tensor<double>(c.rest.shape()), Tensor<double>(c.posed.shape())};
  g.value =
      rigidity_reference(c.rest, c.posed, tensor_of(c.subset), c.edges, strain, weight, g.rest, g.posed);
  return g;
}

struct FastGradients {
  double value = 0;
  Tensor<float> rest, posed;
};

FastGradients fast(const Cloud& c, double weight = 1) {
  FastGradients g{0, Tensor<float>(c.rest.shape()), Tensor<float>(c.posed.shape())};
  g.value = rigidity(convert<float>(c.rest), convert<float>(c.posed), tensor_of(c.subset), c.edges, strain,
                     weight, g.rest, g.posed);
  return g;
}

TEST(Rigidity, FastPathAgreesWithReference) {
  for (const bool leave_some_out : {false, true}) {
    const Cloud c = make_cloud(60, leave_some_out);
    const Gradients expected = reference(c, 0.7);
    const FastGradients found = fast(c, 0.7);
    EXPECT_GT(expected.value, 0.01);
    EXPECT_NEAR(found.value, expected.value, 1e-5 * expected.value);
    expect_close(found.rest, expected.rest, 1e-4, "rest");
    expect_close(found.posed, expected.posed, 1e-4, "posed");
  }
}

TEST(Rigidity, GradientsAgreeWithCentralDifferences) {
  Cloud c = make_cloud(20, true);
  const Gradients g = reference(c);
  expect_close(central_differences(c.rest, [&] { return reference(c).value; }), g.rest, 1e-6, "rest");
  expect_close(central_differences(c.posed, [&] { return reference(c).value; }), g.posed, 1e-6, "posed");
}

TEST(Rigidity, RigidMotionCostsNothingAndGrowthDoes) {
  Cloud c = make_cloud(60, false);
  const double cosine = std::cos(0.8), sine = std::sin(0.8);
  const auto pose = [&](double scale) {
    for (int64_t i = 0; i < c.rest.dim(0); ++i) {
      c.posed(i, 0) = 3 + scale * (cosine * c.rest(i, 0) - sine * c.rest(i, 1));
      c.posed(i, 1) = scale * (sine * c.rest(i, 0) + cosine * c.rest(i, 1));
      c.posed(i, 2) = scale * c.rest(i, 2) - 1;
    }
  };
  pose(1);
  EXPECT_LT(fast(c).value, 1e-9);
  pose(1.2);
  const double grown = fast(c).value;
  EXPECT_GT(grown, 0.1);
  pose(2);
  EXPECT_GT(fast(c).value, grown);
}

TEST(Rigidity, TornEdgesHaveNoGradient) {
  Cloud c = make_cloud(2, false);
  c.edges.index.reset({2, 1});
  c.edges.distance2.reset({2, 1});
  c.edges.index[0] = 1;
  c.edges.index[1] = 0;
  c.edges.distance2.fill(1);
  c.rest.zero();
  c.rest(1, 0) = 1;
  c.posed = c.rest;
  c.posed(1, 0) = 1.1;
  const double stretched = std::abs(fast(c).posed(1, 0));
  c.posed(1, 0) = 4;
  EXPECT_LT(std::abs(fast(c).posed(1, 0)), 0.01 * stretched);
}

TEST(Rigidity, WhatIsNotANumberIsLeftOut) {
  Cloud c = make_cloud(60, true);
  c.posed(3, 1) = std::numeric_limits<double>::quiet_NaN();
  c.rest(7, 0) = std::numeric_limits<double>::infinity();
  std::copy_n(c.rest.row(10), 3, c.rest.row(11));
  c.edges.index(13, 0) = -1;
  const FastGradients g = fast(c);
  EXPECT_TRUE(std::isfinite(g.value));
  EXPECT_TRUE(all_finite(g.rest));
  EXPECT_TRUE(all_finite(g.posed));
  EXPECT_NEAR(g.value, reference(c).value, 1e-5);

  Cloud none = make_cloud(8, false);
  none.edges.index.fill(-1);
  EXPECT_EQ(fast(none).value, 0);
}

TEST(Rigidity, SameBytesAtAnyThreadCount) {
  const Cloud c = make_cloud(500, true);
  expect_same_bytes_at_any_thread_count([&] {
    const FastGradients g = fast(c);
    return std::vector<Tensor<float>>{g.rest, g.posed};
  });
}

}  // namespace
}  // namespace traceflow::loss
