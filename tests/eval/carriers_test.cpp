#include "eval/carriers.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "base/random.h"
#include "splat/ply.h"
#include "support/temp_folder.h"

namespace traceflow::eval {
namespace {

Surfels random_surfels(int64_t n, Random& random) {
  Surfels s{Tensor<float>(Shape{n, 3}), Tensor<float>(Shape{n, 2}),    Tensor<float>(Shape{n, 4}),
            Tensor<float>(Shape{n}),    Tensor<float>(Shape{n, 1, 3}), Tensor<float>(Shape{n})};
  s.for_each([&](const std::string&, Tensor<float>& t) {
    for (float& v : t.values()) v = static_cast<float>(random.normal());
  });
  return s;
}

// In a capture whose coordinates are not the scene's.
viz::Subject moving_subject() {
  Random random(3);
  viz::Subject subject;
  subject.scene.main = random_surfels(80, random);
  NetworkOptions shape;
  shape.depth = 2;
  shape.width = 16;
  shape.skip = 0;
  shape.position_frequencies = shape.time_frequencies = 2;
  Field field = make_field(shape, residual::main_outputs, random);
  for (float& v : field.head_weight.values()) v = static_cast<float>(random.normal());
  subject.scene.main_field = std::move(field);
  subject.scene.normalisation = {{10, -20, 5}, 0.125};
  subject.scene.specular = Specular::none;
  return subject;
}

// The exported surfels that are opaque at time 0.
std::vector<Vec3<double>> exported(const viz::Subject& subject, float time) {
  const TempFolder folder;
  const auto at = [&](float t) {
    return read_ply(viz::export_subject(subject, t, folder.path())[0]).surfels;
  };
  const Surfels rest = at(0), now = at(time);
  std::vector<Vec3<double>> positions;
  for (int64_t i = 0; i < rest.count(); ++i) {
    if (rest.opacity_logit[i] > 0) positions.push_back(load3<double>(now.position.row(i)));
  }
  return positions;
}

void expect_as_exported(const viz::Subject& subject) {
  const Carriers carriers = carriers_of(subject);
  const std::vector<Vec3<double>> rest = exported(subject, 0), later = exported(subject, 0.75F);
  ASSERT_EQ(carriers.rest.dim(0), static_cast<int64_t>(rest.size()));
  ASSERT_GT(rest.size(), 20U);
  const std::vector<int32_t> listed = {17, 3, 5};
  const Tensor<double> moved = carriers.at(listed, 0.75F);
  double way = 0;
  for (int64_t k = 0; k < 3; ++k) {
    const auto i = static_cast<size_t>(listed[static_cast<size_t>(k)]);
    EXPECT_NEAR(length(load3<double>(carriers.rest.row(listed[static_cast<size_t>(k)])) - rest[i]), 0, 1e-5);
    EXPECT_NEAR(length(load3<double>(moved.row(k)) - later[i]), 0, 1e-5);
    way += length(later[i] - rest[i]);
  }
  const bool moves = subject.request.deform_main;
  EXPECT_EQ(way > 0.1, moves) << way;
}

TEST(Carriers, StandWhereTheExportedSurfelsStand) { expect_as_exported(moving_subject()); }

TEST(Carriers, OfARunThatDoesNotYetMoveStandStill) {
  viz::Subject subject = moving_subject();
  subject.request.deform_main = false;
  expect_as_exported(subject);
}

TEST(Carriers, AreFinite) {
  viz::Subject subject = moving_subject();
  const int64_t before = carriers_of(subject).rest.dim(0);
  int64_t row = 0;
  while (carriers_of(subject).rest.dim(0) == before)
    subject.scene.main.position(row++, 1) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(carriers_of(subject).rest.dim(0), before - 1);
  subject.scene.main = {};
  EXPECT_TRUE(carriers_of(subject).rest.empty());
}

}  // namespace
}  // namespace traceflow::eval
