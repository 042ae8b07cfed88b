#include "track/body_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "base/random.h"
#include "math/rotation.h"
#include "math/rotation_group.h"
#include "track/tracker.h"
#include "train/schedule.h"
#include "train/tumbling.h"

namespace traceflow {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

// Points on two spheres whose centres are that far apart, the first with more points; all of one body. Two
// surfels that are not points follow.
Surfels two_spheres(double distance) {
  constexpr int64_t first = 300, second = 100;
  Surfels surfels;
  surfels.position.reset({first + second + 2, 3});
  surfels.sh.reset({first + second + 2, 1, 3});
  Random random(3);
  for (int64_t i = 0; i < first + second; ++i) {
    const Vec3<double> n = normalize(Vec3<double>(random.normal(), random.normal(), random.normal()));
    store3(surfels.position.row(i), i < first ? 0.3 * n : 0.17 * n + Vec3<double>(distance, 0, 0));
  }
  store3(surfels.position.row(first + second), Vec3<double>(-0.2, 0, 0));
  store3(surfels.position.row(first + second + 1), Vec3<double>(distance, 0.1, 0));
  surfels.body.reset({surfels.position.dim(0)});
  return surfels;
}

TEST(BodyParts, AreGroupsThatLieApart) {
  const auto parts = separate_parts(two_spheres(0.9), 400, 0);
  ASSERT_THAT(parts, SizeIs(2));
  EXPECT_THAT(parts[0], SizeIs(301));
  EXPECT_THAT(parts[1], SizeIs(101));
  for (const int64_t row : parts[0]) EXPECT_TRUE(row < 300 || row == 400) << row;
}

TEST(BodyParts, AreNoneWhereABodyHangsTogetherOrIsSmall) {
  EXPECT_THAT(separate_parts(two_spheres(0.45), 400, 0), IsEmpty());
  EXPECT_THAT(separate_parts(two_spheres(0.9), 400, 1), IsEmpty());
  EXPECT_THAT(separate_parts(two_spheres(0.9), 20, 0), IsEmpty());
}

TEST(BodyParts, MoveAsTheirBodyDidUntilTheirPosesAreFoundAnew) {
  Surfels surfels = two_spheres(0.9);
  const auto parts = separate_parts(surfels, 400, 0);
  Tensor<float> centre({2, 3});
  store3(centre.row(0), Vec3<double>(0.2, 0.1, -0.1));
  Motion motion = still_motion(centre, tensor_of(std::vector<float>{0, 1}));
  const Vec4<double> turn = quaternion_exp(Vec3<double>(0.3, -0.7, 0.4));
  for (int c = 0; c < 4; ++c) motion.rotation(0, 1, c) = static_cast<float>(turn[c]);
  store3(&motion.shift(0, 1, 0), Vec3<double>(0.5, -0.3, 0.2));
  const Motion parted = with_part(motion, 0, parts[1], surfels);
  ASSERT_EQ(parted.bodies(), 3);
  const auto moved = [](const Motion& by, int64_t body, const Vec3<double>& x) {
    const Vec3<double> c = load3<double>(by.centre.row(body));
    return rotation_from_quaternion(load4<double>(&by.rotation(body, 1, 0))) * (x - c) + c +
           load3<double>(&by.shift(body, 1, 0));
  };
  for (size_t p = 0; p < 2; ++p) {
    const int32_t body = p == 0 ? 0 : 2;
    for (const int64_t row : parts[p]) {
      EXPECT_EQ(surfels.body[row], body);
      const Vec3<double> x = load3<double>(surfels.position.row(row));
      EXPECT_LT(length(moved(parted, body, x) - moved(motion, 0, x)), 1e-6);
    }
  }
  for (int64_t k = 0; k < 4; ++k) EXPECT_EQ(parted.rotation(1, 1, k), motion.rotation(1, 1, k));
}

// Where poses are off, those that are solved again agree better with the views, whatever is parted.
TEST(BodyParts, AreNotPartedForPosesThatAreOnlySolvedAgain) {
  Tumbling at;
  Surfels& main = at.scene.main;
  const Motion& still = *at.scene.main_motion;
  // Two ends of one rigid thing, without what is between them.
  float low = std::numeric_limits<float>::max(), high = std::numeric_limits<float>::lowest();
  for (int64_t i = 0; i < main.count(); ++i) {
    if (main.body[i] != 0) continue;
    low = std::min(low, main.position(i, 2));
    high = std::max(high, main.position(i, 2));
  }
  for (int64_t i = 0; i < main.count(); ++i) {
    const float from_middle = std::abs(main.position(i, 2) - (low + high) / 2);
    if (main.body[i] == 0 && from_middle < 0.2F * (high - low)) main.body[i] = moved_by_field;
  }
  ASSERT_THAT(separate_parts(main, main.count(), 0), SizeIs(2));
  const TrainOptions options = preset("cpu");
  const Tracker tracker(options.deform.track, Schedule(options).render(0), at.capture);
  Motion motion = still;
  EXPECT_EQ(tracker.part_bodies(main, main.count(), motion, 5, at.scene.extent), 0);
  EXPECT_EQ(motion.bodies(), still.bodies());
}

}  // namespace
}  // namespace traceflow
