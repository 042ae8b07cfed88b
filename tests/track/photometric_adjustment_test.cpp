#include "track/photometric_adjustment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "base/random.h"
#include "ops/motion/nodes.h"
#include "support/gradients.h"
#include "track/ball_body.h"
#include "track/bodies.h"

namespace traceflow {
namespace {

using ball_body::ball, ball_body::centre, ball_body::picture_of, ball_body::radius;

constexpr int64_t film_keys = 12;

// A ball with a pattern that is a few pixels wide.
Surfels wavy_ball() {
  Surfels s = ball();
  s.log_scale.fill(std::log(0.03F));
  for (int64_t i = 0; i < s.count(); ++i) {
    const Vec3<double> x = load3<double>(s.position.row(i)) - centre;
    const double wave = std::sin(25 * x.x + 4 * x.y) + std::sin(22 * x.y + 1) + std::sin(28 * x.z + 2);
    ball_body::paint(Vec3<double>(0.5 + 0.15 * wave, 0.5 - 0.1 * wave, 0.4), s.sh.row(i));
  }
  return s;
}

Motion still() {
  Tensor<float> pivot({1, 3}), time({film_keys});
  store3(pivot.row(0), centre);
  for (int64_t k = 0; k < film_keys; ++k) time[k] = static_cast<float>(k) / (film_keys - 1);
  return still_motion(pivot, time);
}

void set_turn(Motion& motion, int64_t key, const Vec3<double>& by) {
  const Vec4<double> q = quaternion_exp(by);
  for (int k = 0; k < 4; ++k) motion.rotation(0, key, k) = static_cast<float>(q[k]);
}
Vec3<double> turn_at(const Motion& motion, int64_t key) {
  return quaternion_log(unit_quaternion(load4<double>(&motion.rotation(0, key, 0))));
}

// How the ball turns, and, where it has nodes, bends.
struct Film {
  Surfels surfels = wavy_ball();
  Motion motion = still();
  Nodes nodes;

  explicit Film(bool bends) {
    for (int64_t k = 0; k < film_keys; ++k)
      set_turn(motion, k, static_cast<double>(k) * Vec3<double>(0.01, 0.03, -0.005));
    if (!bends) return;
    nodes = place_nodes(motion, surfels, 8, 3);
    for (int64_t n = 0; n < nodes.count(); ++n) {
      const Vec3<double> arm = load3<double>(nodes.centre.row(n)) - centre;
      for (int64_t time = 1; time < nodes.times(); ++time) {
        const double share = static_cast<double>(time) / static_cast<double>(nodes.times() - 1);
        // Twisted about the vertical.
        store3(&nodes.turn(n, time, 0), Vec3<double>(0, 0.3 * share * arm.y, 0));
        store3(&nodes.shift(n, time, 0), 0.3 * share * arm.y * Vec3<double>(arm.z, 0, -arm.x));
      }
    }
  }

  // The surfels bent as they are at a key.
  Surfels bent(const Nodes& by, int64_t key) const {
    Surfels s = surfels;
    nodes::bend(by, s.body, motion.time[key], s);
    return s;
  }

  FilmViews views(double blur, double noise = 0) const {
    Random random(1);
    std::vector<FilmView> result;
    for (int64_t k = 0; k < film_keys; ++k) {
      TrackTarget picture = picture_of(bent(nodes, k), turn_at(motion, k), false);
      for (int64_t i = 0; i < picture.colour.size(); ++i)
        picture.colour[i] += static_cast<float>(noise * random.normal());
      result.push_back({k, picture.camera,
                        detail_of({picture.camera, picture.colour, picture.coverage}, blur),
                        DetailPhoto{picture.camera, picture.normal_prior, picture.mask}});
    }
    return std::make_shared<const std::vector<FilmView>>(std::move(result));
  }

  // How far points are from where they should be, on average, in radii.
  double off(const Motion& found, const Nodes& bends) const {
    double sum = 0;
    for (int64_t k = 0; k < film_keys; ++k) {
      const Surfels should = bent(nodes, k), is = bent(bends, k);
      const auto placed = [&](const Surfels& s, const Motion& by, int64_t i) {
        const Mat3<double> rotation =
            rotation_from_quaternion(unit_quaternion(load4<double>(&by.rotation(0, k, 0))));
        return rotation * (load3<double>(s.position.row(i)) - centre) + load3<double>(&by.shift(0, k, 0));
      };
      for (int64_t i = 0; i < surfels.count(); ++i) {
        if (surfels.position(i, 2) > centre.z) continue;  // seen by none
        sum += glm::length(placed(should, motion, i) - placed(is, found, i));
      }
    }
    return sum / (radius * film_keys * static_cast<double>(surfels.count()) / 2);
  }
};

TEST(PhotometricAdjustment, TheEquationsHoldTheCostsDerivative) {
  const Film film(true);
  Motion motion = film.motion;
  Nodes nodes = film.nodes;
  for (int64_t k = 1; k < film_keys; ++k) {
    set_turn(motion, k, turn_at(motion, k) + Vec3<double>(0.01, -0.02, 0.015));
    motion.shift(0, k, 0) += 0.01F;
    motion.shift(0, k, 2) += 0.02F;
  }
  for (int64_t i = 0; i < nodes.turn.size(); ++i) {
    nodes.turn[i] *= 0.7F;
    nodes.shift[i] *= 0.6F;
  }
  Motion start = film.motion;
  Nodes start_nodes = film.nodes;
  PhotometricAdjustment adjustment(film.surfels, 0, {}, start, &start_nodes);
  adjustment.observe(film.views(2));
  start = motion;
  start_nodes = nodes;
  using Derivatives = PhotometricAdjustment::Derivatives;
  const PhotometricAdjustment::Equations equations = adjustment.equations(Derivatives::own);
  Random random(5);
  for (int trial = 0; trial < 8; ++trial) {
    // Numbers of the first time do not move.
    Eigen::VectorXd step = Eigen::VectorXd::Zero(equations.b.size());
    for (int64_t i = 8 * 6 + 3 * 6; i < step.size(); ++i) step[i] = random.normal();
    constexpr double size = 5e-4;
    const auto cost_at = [&](double by) {
      adjustment.take(by * step);
      const double cost = adjustment.cost();
      start = motion;
      start_nodes = nodes;
      return cost;
    };
    const double expected = -(cost_at(size) - cost_at(-size)) / (2 * size), found = equations.b.dot(step);
    EXPECT_GT(std::abs(expected), 1);
    EXPECT_NEAR(found, expected, 0.03 * equations.b.norm()) << trial;
  }
}

// From poses that lag, and no bend at all.
TEST(PhotometricAdjustment, FindsHowABodyMovesAndBends) {
  for (const bool bends : {false, true}) {
    const Film film(bends);
    Motion motion = film.motion;
    for (int64_t k = 1; k < film_keys; ++k)
      set_turn(motion, k, 0.7 * turn_at(motion, k) + Vec3<double>(0, k % 2 == 0 ? 0.02 : -0.02, 0));
    Nodes nodes = film.nodes;
    nodes.turn.fill(0);
    nodes.shift.fill(0);
    const double before = film.off(motion, nodes);
    PhotometricAdjustment adjustment(film.surfels, 0, {}, motion, bends ? &nodes : nullptr);
    double cost = 0;
    for (const double blur : {2.0, 1.0, 0.0}) {
      adjustment.observe(film.views(blur));
      cost = adjustment.mean_texture_cost();
      adjustment.solve(4);
    }
    EXPECT_LT(adjustment.mean_texture_cost(), cost);
    EXPECT_LT(film.off(motion, nodes), (bends ? 0.5 : 0.35) * before) << bends;
    EXPECT_EQ(turn_at(motion, 0), turn_at(film.motion, 0));
  }
}

// All times but the first are off by the same: only their differences from the first tell, and noise must not
// outweigh them.
TEST(PhotometricAdjustment, NoiseDoesNotHoldWhatIsOffAtAllTimes) {
  const Film film(false);
  Motion motion = film.motion;
  for (int64_t k = 1; k < film_keys; ++k) set_turn(motion, k, turn_at(motion, k) + Vec3<double>(0, 0.04, 0));
  const double before = film.off(motion, {});
  PhotometricAdjustment adjustment(film.surfels, 0, {}, motion, nullptr);
  adjustment.observe(film.views(0, 0.02));
  adjustment.solve(4);
  EXPECT_LT(film.off(motion, {}), 0.4 * before);
}

TEST(PhotometricAdjustment, IsTheSameAtAnyThreadCount) {
  const Film film(true);
  testing::expect_same_bytes_at_any_thread_count([&] {
    Motion motion = film.motion;
    for (int64_t k = 1; k < film_keys; ++k) set_turn(motion, k, 0.9 * turn_at(motion, k));
    Nodes nodes = film.nodes;
    PhotometricAdjustment adjustment(film.surfels, 0, {}, motion, &nodes);
    adjustment.observe(film.views(1));
    adjustment.solve(2);
    return std::vector<Tensor<float>>{motion.rotation, motion.shift, nodes.turn, nodes.shift};
  });
}

}  // namespace
}  // namespace traceflow
