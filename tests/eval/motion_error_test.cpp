#include "eval/motion_error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/random.h"
#include "math/rotation.h"
#include "math/similarity_fit.h"

namespace traceflow::eval {
namespace {

using Motion = std::function<Vec3<double>(const Vec3<double>& x, double time)>;

// Points a fifth apart, so that no surfel around one carries another; each object has its own corner.
MotionTruth truth_of(const std::vector<std::pair<int32_t, int64_t>>& objects, int64_t times,
                     const Motion& motion, uint64_t seed = 1) {
  Random random(seed);
  std::vector<Vec3<double>> points;
  std::vector<int32_t> ids;
  for (const auto& [id, count] : objects) {
    for (int64_t i = 0; i < count; ++i) {
      const Vec3<int64_t> place(i % 3, i / 3 % 3, i / 9);
      points.push_back(Vec3<double>(id, 0, 0) + 0.2 * Vec3<double>(place) +
                       0.02 * Vec3<double>(random.uniform(), random.uniform(), random.uniform()));
      ids.push_back(id);
    }
  }
  MotionTruth truth{Tensor<float>({times, static_cast<int64_t>(points.size()), 3}),
                    Tensor<int32_t>({static_cast<int64_t>(points.size())})};
  for (int64_t i = 0; i < truth.count(); ++i) {
    truth.object[i] = ids[static_cast<size_t>(i)];
    for (int64_t t = 0; t < times; ++t) {
      store3(&truth.points(t, i, 0),
             motion(points[static_cast<size_t>(i)], static_cast<double>(t) / static_cast<double>(times - 1)));
    }
  }
  return truth;
}

// At each point one surfel and two that lie opposite each other: their mean moves as the point does.
Carriers carriers_around(const MotionTruth& truth, const Motion& motion, uint64_t seed = 2) {
  Random random(seed);
  Carriers carriers;
  carriers.rest = Tensor<double>({3 * truth.count(), 3});
  for (int64_t i = 0; i < truth.count(); ++i) {
    const Vec3<double> aside = 0.01 * Vec3<double>(random.normal(), random.normal(), random.normal());
    const auto x = load3<double>(&truth.points(0, i, 0));
    store3(carriers.rest.row(3 * i), x);
    store3(carriers.rest.row(3 * i + 1), x + aside);
    store3(carriers.rest.row(3 * i + 2), x - aside);
  }
  carriers.at = [rest = carriers.rest, motion](const std::vector<int32_t>& listed, float time) {
    Tensor<double> now({static_cast<int64_t>(listed.size()), 3});
    for (size_t i = 0; i < listed.size(); ++i)
      store3(now.row(static_cast<int64_t>(i)), motion(load3<double>(rest.row(listed[i])), time));
    return now;
  };
  return carriers;
}

Motion turn(double degrees, const Vec3<double>& shift, double growth = 0) {
  return [=](const Vec3<double>& x, double time) {
    const double half = time * degrees * std::numbers::pi / 360;
    const auto r =
        rotation_from_quaternion(Vec4<double>(std::cos(half), 0, 0.6 * std::sin(half), 0.8 * std::sin(half)));
    return (1 + time * growth) * (r * x) + time * shift;
  };
}

const Motion still = [](const Vec3<double>& x, double) { return x; };

RC_GTEST_PROP(MotionError, of_a_scene_that_moves_as_its_points_is_none, ()) {
  Random random(*rc::gen::arbitrary<uint64_t>());
  const Motion motion = turn(170 * random.uniform(), {random.normal(), random.normal(), random.normal()});
  const MotionTruth truth = truth_of({{1, 12}, {2, 5}}, *rc::gen::inRange<int64_t>(2, 20), motion);
  const MotionReport report = motion_error(truth, carriers_around(truth, motion));
  RC_ASSERT(report.objects.size() == 2U);
  for (const ObjectMotion& o : report.objects) {
    RC_ASSERT(o.followed_points == o.points);
    RC_ASSERT(*o.figures.share < 1e-5);
    RC_ASSERT(*o.figures.rotation_error_deg < 1e-3);
    RC_ASSERT(std::abs(*o.figures.scale - 1) < 1e-5);
    for (const MotionMoment& m : o.curve) RC_ASSERT(m.missed < 1e-5);
  }
  RC_ASSERT(*report.mean.share < 1e-5);
}

TEST(MotionError, of_a_scene_that_stands_still_is_one) {
  const Motion motion = turn(80, {1, 0.5, -0.2});
  const MotionTruth truth = truth_of({{3, 10}}, 9, motion);
  const MotionReport report = motion_error(truth, carriers_around(truth, still));
  const MotionFigures& f = report.objects.at(0).figures;
  EXPECT_NEAR(*f.share, 1, 1e-9);
  EXPECT_NEAR(*f.missed, *f.moved, 1e-9);
  EXPECT_NEAR(*f.scale, 1, 1e-9);
  EXPECT_NEAR(*f.rotation_error_deg, 80 * 4.5 / 8, 1e-3) << "the mean of eighths of the turn";
  ASSERT_EQ(report.objects[0].curve.size(), 9U);
  for (size_t t = 0; t < 9; ++t)
    EXPECT_NEAR(report.objects[0].curve[t].rotation_error_deg, 10.0 * static_cast<double>(t), 1e-3);
}

RC_GTEST_PROP(MotionError, of_a_scene_that_goes_a_part_of_the_way_is_the_rest, ()) {
  Random random(*rc::gen::arbitrary<uint64_t>());
  const double part = random.uniform();
  const Vec3<double> way(random.normal(), random.normal(), random.normal());
  const MotionTruth truth = truth_of({{1, 8}}, 17, turn(0, way));
  const MotionReport report = motion_error(truth, carriers_around(truth, turn(0, part * way)));
  RC_ASSERT(std::abs(*report.mean.share - (1 - part)) < 1e-4);
  RC_ASSERT(std::abs(*report.mean.moved - 4.5 / 8 * length(way)) < 1e-4);
}

TEST(MotionError, tells_turning_and_stretching_from_truth) {
  const MotionTruth truth = truth_of({{0, 27}}, 9, turn(40, {0.1, 0, 0}));
  const MotionReport report = motion_error(truth, carriers_around(truth, turn(24, {0.3, 0, 0}, 0.5)));
  const ObjectMotion& o = report.objects.at(0);
  EXPECT_NEAR(o.curve.back().rotation_error_deg, 16, 1e-3);
  EXPECT_NEAR(o.curve.back().scale, 1.5, 1e-4);
  EXPECT_NEAR(o.curve.back().true_scale, 1, 1e-5);
  EXPECT_NEAR(*o.figures.scale, 1 + 0.5 * 4.5 / 8, 1e-4);
}

// Halves are rounded to the even time, as Python rounds them.
TEST(MotionError, samples_eight_times_of_any_number) {
  const MotionTruth truth = truth_of({{1, 8}}, 5, turn(0, {4, 0, 0}));
  const MotionReport report = motion_error(truth, carriers_around(truth, still));
  EXPECT_NEAR(*report.mean.moved, (0 + 1 + 2 + 2 + 2 + 3 + 4 + 4) / 8.0, 1e-5);
}

// The eight nearest, found and weighed one by one.
TEST(MotionError, points_go_by_the_weighted_mean_of_the_eight_nearest) {
  Random random(5);
  MotionTruth truth = truth_of({{1, 6}}, 2, turn(0, {1, 0, 0}));
  Carriers carriers;
  carriers.rest = Tensor<double>({200, 3});
  for (int64_t k = 0; k < 200; ++k) {
    const auto x = load3<double>(&truth.points(0, k % 6, 0));
    store3(carriers.rest.row(k), x + 0.03 * Vec3<double>(random.normal(), random.normal(), random.normal()));
  }
  const auto step = [](int64_t surfel) { return Vec3<double>(0.01 * static_cast<double>(surfel), 0, 0); };
  carriers.at = [&](const std::vector<int32_t>& listed, float time) {
    Tensor<double> now({static_cast<int64_t>(listed.size()), 3});
    for (size_t i = 0; i < listed.size(); ++i) {
      store3(now.row(static_cast<int64_t>(i)),
             load3<double>(carriers.rest.row(listed[i])) + static_cast<double>(time) * step(listed[i]));
    }
    return now;
  };
  std::vector<double> missed;
  for (int64_t i = 0; i < 6; ++i) {
    const auto p = load3<double>(&truth.points(0, i, 0));
    std::vector<std::pair<double, int64_t>> near;
    for (int64_t k = 0; k < 200; ++k) near.emplace_back(length(load3<double>(carriers.rest.row(k)) - p), k);
    std::sort(near.begin(), near.end());
    Vec3<double> sum(0);
    double weights = 0;
    for (size_t k = 0; k < 8; ++k) {
      const double weight = std::exp(-0.5 * near[k].first * near[k].first / (0.02 * 0.02));
      sum += weight * step(near[k].second);
      weights += weight;
    }
    missed.push_back(length(load3<double>(&truth.points(1, i, 0)) - p - sum / weights));
  }
  std::sort(missed.begin(), missed.end());
  const MotionReport report = motion_error(truth, carriers);
  EXPECT_NEAR(report.objects.at(0).curve.back().missed, (missed[2] + missed[3]) / 2, 1e-9);
}

TEST(MotionError, a_thing_without_surfels_is_not_followed_and_in_no_mean) {
  const Motion motion = turn(30, {0.5, 0, 0});
  const MotionTruth truth = truth_of({{1, 8}, {7, 6}}, 9, motion);
  Carriers carriers = carriers_around(truth, motion);
  // Of thing 7 three points keep surfels; those of the others stand out of reach.
  for (int64_t i = 3 * (8 + 3); i < carriers.rest.dim(0); ++i) carriers.rest(i, 2) += 0.1;
  const MotionReport report = motion_error(truth, carriers);
  ASSERT_EQ(report.objects.size(), 2U);
  const ObjectMotion& lost = report.objects[1];
  EXPECT_EQ(lost.object, 7);
  EXPECT_EQ(lost.points, 6);
  EXPECT_EQ(lost.followed_points, 3);
  EXPECT_FALSE(lost.figures.share || lost.figures.moved || lost.figures.scale);
  EXPECT_TRUE(lost.curve.empty());
  EXPECT_EQ(report.mean.missed, report.objects[0].figures.missed);

  carriers.rest = {};
  const MotionReport none = motion_error(truth, carriers);
  EXPECT_EQ(none.objects.at(0).followed_points, 0);
  EXPECT_FALSE(none.mean.share || none.mean.missed);
}

TEST(MotionError, fewer_surfels_than_eight_carry_a_point_too) {
  const Motion motion = turn(0, {0.4, 0, 0});
  const MotionTruth truth = truth_of({{1, 4}}, 3, motion);
  Carriers carriers = carriers_around(truth, motion);
  Tensor<double> first({4, 3});
  for (int64_t i = 0; i < 4; ++i) store3(first.row(i), load3<double>(carriers.rest.row(3 * i)));
  carriers.rest = first;
  carriers.at = [&](const std::vector<int32_t>& listed, float time) {
    Tensor<double> now({static_cast<int64_t>(listed.size()), 3});
    for (size_t i = 0; i < listed.size(); ++i) {
      store3(now.row(static_cast<int64_t>(i)),
             motion(load3<double>(first.row(listed[i])), static_cast<double>(time)));
    }
    return now;
  };
  const MotionReport report = motion_error(truth, carriers);
  EXPECT_EQ(report.objects.at(0).followed_points, 4);
  EXPECT_LT(*report.mean.share, 1e-5);
}

TEST(MotionError, the_mean_is_by_points) {
  // One thing goes as it should, the other stays.
  const Motion motion = turn(0, {0.4, 0, 0});
  const MotionTruth truth = truth_of({{1, 15}, {5, 5}}, 9, motion);
  const Motion first_alone = [&](const Vec3<double>& x, double time) {
    return x.x < 4 ? motion(x, time) : x;
  };
  EXPECT_NEAR(*motion_error(truth, carriers_around(truth, first_alone)).mean.share, 0.25, 1e-4);
}

TEST(MotionError, a_thing_that_does_not_move_has_no_share) {
  const MotionTruth truth = truth_of({{1, 8}}, 3, still);
  const MotionReport report = motion_error(truth, carriers_around(truth, turn(0, {0.25, 0, 0})));
  EXPECT_EQ(*report.mean.moved, 0);
  EXPECT_GT(*report.mean.missed, 0.1);
  EXPECT_FALSE(report.mean.share || report.objects.at(0).curve.back().share);
}

TEST(MotionError, a_surfel_that_is_not_finite_at_a_time_stays) {
  const Motion motion = turn(0, {1, 0, 0});
  const MotionTruth truth = truth_of({{1, 8}}, 2, motion);
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const Motion gone = [](const Vec3<double>& x, double time) { return time > 0.5 ? Vec3<double>(nan) : x; };
  EXPECT_NEAR(*motion_error(truth, carriers_around(truth, gone)).mean.share, 1, 1e-9);
}

}  // namespace
}  // namespace traceflow::eval
