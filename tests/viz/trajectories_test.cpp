#include "viz/trajectories.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/npy.h"
#include "support/file_bytes.h"
#include "support/glb_file.h"
#include "support/refusal.h"
#include "support/temp_folder.h"
#include "viz/moving_board.h"

namespace traceflow::viz {
namespace {

// The board in a capture whose coordinates are not the scene's, seen from another place at each time.
struct Film {
  MovingBoard board;
  std::vector<Shot> shots;

  Film() {
    board.scene.normalisation = {{10, -20, 5}, 0.125};
    for (const float time : {0.5F, 0.0F, 1.0F, 0.25F}) {
      Camera<float> camera = board.request.camera;
      camera.position = {0.2F * time, -0.1F, -3};
      shots.push_back({"view", time, camera});
    }
  }
  Trajectories trajectories() const {
    return follow_surfels({board.scene, board.options, board.request, ""}, shots);
  }
};

TEST(Trajectories, AreThePosesAndTheirProjections) {
  const Film film;
  const Trajectories paths = film.trajectories();
  ASSERT_EQ(paths.count(), MovingBoard::points);
  ASSERT_EQ(paths.time.size(), 4);
  for (int64_t t = 0; t < 4; ++t) {
    const float time = std::vector<float>{0, 0.25F, 0.5F, 1}[static_cast<size_t>(t)];
    EXPECT_EQ(paths.time[t], time);
    Camera<float> camera = film.board.request.camera;
    camera.position = {0.2F * time, -0.1F, -3};
    for (int64_t p = 0; p < paths.count(); ++p) {
      const Vec3<double> place = film.board.place_at(p, time);
      const Vec3<double> in_capture = place / 0.125 + Vec3<double>(10, -20, 5);
      EXPECT_LT(length(load3<double>(&paths.position(t, p, 0)) - in_capture), 1e-4) << t << " " << p;
      const Vec2<double> pixel = MovingBoard::pixel_of(place, camera);
      EXPECT_NEAR(paths.tracks(t, p, 0), pixel.x - 0.5, 1e-3);
      EXPECT_NEAR(paths.tracks(t, p, 1), pixel.y - 0.5, 1e-3);
      EXPECT_EQ(paths.visibility(t, p), 1);
    }
  }
}

TEST(Trajectories, AreInvisibleBehindASurfaceAndOutsideTheImage) {
  Film film;
  Surfels& s = film.board.scene.main;
  // A surfel of the wall moves before the left half of the board.
  store3(s.position.row(MovingBoard::points), Vec3<float>(-0.6F, 0, -1));
  s.log_scale(MovingBoard::points, 0) = std::log(0.5F);
  s.log_scale(MovingBoard::points, 1) = std::log(3.0F);
  s.opacity_logit[MovingBoard::points] = 12;
  for (Shot& shot : film.shots) shot.camera.height = shot.camera.height * 52 / 100;
  const Trajectories paths = film.trajectories();
  int64_t hidden = 0, outside = 0;
  for (int64_t t = 0; t < 4; ++t) {
    for (int64_t p = 0; p < paths.count(); ++p) {
      const Vec3<double> place = film.board.place_at(p, paths.time[t]);
      const Vec3<double> from(0.2 * paths.time[t], -0.1, -3);
      // Where the line of sight crosses the plane of the surfel in front.
      const double x = from.x + (place.x - from.x) * 2 / (place.z + 3);
      if (std::abs(x + 0.1) < 0.02) continue;  // its edge, three standard deviations, is soft
      const bool is_outside = paths.tracks(t, p, 1) > static_cast<float>(film.shots[0].camera.height) - 0.5F;
      const bool is_behind = x < -0.1;
      if (is_outside) {
        EXPECT_EQ(paths.visibility(t, p), 0);
      }
      outside += is_outside ? 1 : 0;
      hidden += is_behind && paths.visibility(t, p) == 0 ? 1 : 0;
      if (x > 0.6 && !is_outside) {
        EXPECT_EQ(paths.visibility(t, p), 1);
      }
    }
  }
  EXPECT_GT(hidden, 4);
  EXPECT_GT(outside, 4);
}

TEST(Trajectories, ReadBackAsWritten) {
  const TempFolder folder;
  const Trajectories paths = Film().trajectories();
  write_trajectories_npz(folder / "t.npz", paths);
  for (const auto& [name, array] : {std::pair("tracks", &paths.tracks),
                                    {"visibility", &paths.visibility},
                                    {"position", &paths.position},
                                    {"time", &paths.time}}) {
    const Tensor<float> read = read_npz(folder / "t.npz", name);
    EXPECT_EQ(read.shape(), array->shape()) << name;
    EXPECT_TRUE(std::ranges::equal(read.values(), array->values())) << name;
  }
}

TEST(Trajectories, AreLinesInGltf) {
  const TempFolder folder;
  const Trajectories paths = Film().trajectories();
  write_trajectories_glb(folder / "t.glb", paths);
  const GlbFile file(bytes_of(folder / "t.glb"));
  const auto points = static_cast<size_t>(paths.count());
  EXPECT_EQ(file.primitive().at("mode"), 1) << "LINES";
  const size_t position =
      file.place_of(file.primitive().at("attributes").at("POSITION"), 5126, "VEC3", 4 * points, 12);
  const size_t index = file.place_of(file.primitive().at("indices"), 5125, "SCALAR", 3 * points * 2, 4);
  for (size_t line = 0; line < 3 * points; ++line) {
    const size_t t = line / points, p = line % points;
    for (size_t end = 0; end < 2; ++end) {
      const auto vertex = number_at<uint32_t>(file.binary, index + 4 * (2 * line + end));
      for (size_t c = 0; c < 3; ++c) {
        EXPECT_EQ(
            number_at<float>(file.binary, position + 12 * vertex + 4 * c),
            paths.position(static_cast<int64_t>(t + end), static_cast<int64_t>(p), static_cast<int64_t>(c)));
      }
    }
  }
}

TEST(Trajectories, NeedMotion) {
  Film film;
  film.board.scene.main_motion.reset();
  EXPECT_THAT(refusal_of([&] { film.trajectories(); }), testing::HasSubstr("no surfel that moves"));
}

}  // namespace
}  // namespace traceflow::viz
