#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "base/random.h"
#include "broken_capture.h"
#include "capture/checks/checks.h"

// Tracks of the points of a scene, true ones and others.
namespace traceflow {
namespace {

using testing::HasSubstr;
using testing::Not;

// The cameras and points of a synthetic film, without its images.
Capture film() {
  SynthOptions options;
  options.frames = 40;
  options.width = 480;
  options.height = 270;
  Capture capture;
  for (const SynthView& view : synth_views(options)) {
    if (!view.is_test)
      capture.train.push_back({view.id, static_cast<float>(view.time), convert<float>(view.camera)});
  }
  capture.points = synth_points(options);
  return capture;
}

// Where points that stand still are in each training view: T×N×3, as in tracks.npy.
Tensor<float> true_tracks(const Capture& capture) {
  const auto views = static_cast<int64_t>(capture.train.size());
  const int64_t points = std::min<int64_t>(300, capture.points.dim(0));
  Tensor<float> tracks({views, points, 3});
  for (int64_t v = 0; v < views; ++v) {
    const Camera<float>& camera = capture.train[static_cast<size_t>(v)].camera;
    for (int64_t n = 0; n < points; ++n) {
      const Vec3<float> point = load3<float>(capture.points.row(n));
      if (!camera.sees(point)) continue;
      const Vec2<float> at = camera.project(camera.point_in_camera(point));
      store3(&tracks(v, n, 0), Vec3<float>(at.x / static_cast<float>(camera.width),
                                           at.y / static_cast<float>(camera.height), 1));
    }
  }
  return tracks;
}

void take_tracks(Capture& capture, const Tensor<float>& stored) {
  const Shape shape{stored.dim(0), stored.dim(1)};
  capture.tracks = {Tensor<float>({shape[0], shape[1], 2}), Tensor<uint8_t>(shape)};
  for (int64_t v = 0; v < shape[0]; ++v) {
    const Camera<float>& camera = capture.train[static_cast<size_t>(v)].camera;
    for (int64_t n = 0; n < shape[1]; ++n) {
      const Vec3<float> ray = camera.ray_in_camera(stored(v, n, 0) * static_cast<float>(camera.width),
                                                   stored(v, n, 1) * static_cast<float>(camera.height));
      capture.tracks.direction(v, n, 0) = ray.x;
      capture.tracks.direction(v, n, 1) = ray.y;
      capture.tracks.seen(v, n) = stored(v, n, 2) > 0 ? 1 : 0;
    }
  }
}

// The share of the tracks that agree, all of them off the masks, and what is found.
double agreeing(Capture& capture, const Tensor<float>& stored, Findings& findings) {
  take_tracks(capture, stored);
  capture.has_masks = true;
  std::vector<ViewFacts> facts(capture.train.size());
  for (size_t v = 0; v < facts.size(); ++v) facts[v].view = &capture.train[v];
  const Inspection::Tracks result = check_tracks(capture, facts, findings);
  EXPECT_GT(result.compared, 1000);
  EXPECT_EQ(result.agreeing, result.consistent);
  return result.agreeing.value_or(-1);
}

// The tracks' rows in another order.
Tensor<float> in_order(const Tensor<float>& tracks, const std::vector<int64_t>& order) {
  Tensor<float> result(tracks.shape());
  for (size_t v = 0; v < order.size(); ++v)
    std::copy_n(tracks.row(order[v]), tracks.dim(1) * 3, result.row(static_cast<int64_t>(v)));
  return result;
}

TEST(TrackChecks, AgreeToTwoPixelsAndNotFarBeyond) {
  Capture capture = film();
  const Tensor<float> tracks = true_tracks(capture);
  for (const auto& [pixels, least, most] :
       {std::tuple{0.0, 1.0, 1.0}, std::tuple{0.9, 0.99, 1.0}, std::tuple{20.0, 0.0, 0.25}}) {
    Random random(3);
    Tensor<float> noisy = tracks;
    for (int64_t i = 0; i < noisy.size(); i += 3) {
      const double angle = random.uniform(0, 6.28);
      noisy[i] += static_cast<float>(pixels / 480 * std::cos(angle));
      noisy[i + 1] += static_cast<float>(pixels / 270 * std::sin(angle));
    }
    Findings findings;
    const double share = agreeing(capture, noisy, findings);
    EXPECT_GE(share, least) << pixels;
    EXPECT_LE(share, most) << pixels;
    EXPECT_EQ(findings.empty(), pixels < 1);
  }
}

TEST(TrackChecks, OfAnotherOrderWidthOrRateDisagree) {
  Capture capture = film();
  const Tensor<float> tracks = true_tracks(capture);
  const auto expect_problem = [&](const Tensor<float>& wrong, const char* what) {
    Findings findings;
    const double share = agreeing(capture, wrong, findings);
    ASSERT_EQ(findings.size(), 1U) << what << " " << share;
    EXPECT_EQ(findings[0].kind, "tracks-disagree");
    EXPECT_EQ(findings[0].severity, Severity::problem);
    EXPECT_THAT(findings[0].text,
                HasSubstr("% of the tracks off the masks agree with the cameras: are they"));
    EXPECT_EQ(findings[0].value, share);
  };
  std::vector<int64_t> order(static_cast<size_t>(tracks.dim(0)));
  std::iota(order.rbegin(), order.rend(), 0);
  expect_problem(in_order(tracks, order), "backwards");
  Random random(1);
  for (size_t i = order.size() - 1; i > 0; --i)
    std::swap(order[i], order[static_cast<size_t>(random.below(static_cast<int64_t>(i) + 1))]);
  expect_problem(in_order(tracks, order), "shuffled");
  for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int64_t>(i / 3);
  expect_problem(in_order(tracks, order), "another frame rate");
  for (const float factor : {0.5F, 0.75F}) {
    Tensor<float> narrow = tracks;
    for (int64_t i = 0; i < narrow.size(); i += 3) narrow[i] *= factor, narrow[i + 1] *= factor;
    expect_problem(narrow, factor < 0.6F ? "half as wide" : "three quarters as wide");
  }
}

// What moves need not agree, where masks say that it moves.
TEST(TrackChecks, OnMasksAreLeftOut) {
  Capture capture = film();
  const Tensor<float> still = true_tracks(capture);
  std::vector<int64_t> order(static_cast<size_t>(still.dim(0)));
  std::iota(order.rbegin(), order.rend(), 0);
  take_tracks(capture, in_order(still, order));
  std::vector<ViewFacts> facts(capture.train.size());
  for (size_t v = 0; v < facts.size(); ++v) facts[v].view = &capture.train[v];
  // Without masks nobody knows what moves: a notice.
  Findings findings;
  check_tracks(capture, facts, findings);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].severity, Severity::notice);
  EXPECT_THAT(findings[0].text, Not(HasSubstr("off the masks")));
  capture.has_masks = true;
  for (ViewFacts& view : facts) view.track_on_mask.assign(static_cast<size_t>(still.dim(1)), 1);
  findings.clear();
  const Inspection::Tracks result = check_tracks(capture, facts, findings);
  EXPECT_TRUE(findings.empty());
  EXPECT_EQ(result.consistent, 1);
  EXPECT_EQ(result.compared, 0);
  EXPECT_FALSE(result.agreeing);
}

// From files: decoded masks, and with --quick fewer views.
TEST(TrackChecks, AreAPartOfTheInspection) {
  const BrokenCapture capture;
  const Capture loaded = load_capture(capture / "", {});
  write_npy(capture / "tracks.npy", true_tracks(loaded));
  int64_t compared[2] = {};
  for (const bool quick : {false, true}) {
    const Inspection found = inspect(load_capture(capture / "", {}), quick);
    EXPECT_TRUE(found.findings.empty());
    EXPECT_EQ(found.tracks.points, 300);
    EXPECT_EQ(found.tracks.agreeing, 1);
    compared[quick ? 1 : 0] = found.tracks.compared;
  }
  EXPECT_GT(compared[1], 1000);
  EXPECT_GT(compared[0], compared[1]);
  for (const View& view : loaded.train)
    capture.edit_image("mask/1x/" + view.id + ".png.png", [](auto& mask) { mask.fill(255); });
  const Inspection masked = inspect(load_capture(capture / "", {}));
  EXPECT_EQ(masked.tracks.compared, 0);
  EXPECT_EQ(masked.tracks.consistent, 1);
}

Camera<float> camera_at(const Vec3<float>& position) {
  Camera<float> camera;
  camera.width = 200;
  camera.height = 100;
  camera.focal_x = camera.focal_y = 100;
  camera.centre_x = 100;
  camera.centre_y = 50;
  camera.position = position;
  return camera;
}

// Two cameras side by side, whose epipolar lines are horizontal: only the sign of the parallax tells them
// from the same two in the other order.
TEST(TrackChecks, AParallaxOfTheWrongSignDisagrees) {
  for (const bool is_right : {true, false}) {
    Capture capture;
    constexpr int64_t points = 200, views = 4;
    capture.tracks = {Tensor<float>({views, points, 2}), Tensor<uint8_t>({views, points})};
    capture.tracks.seen.fill(1);
    for (int64_t v = 0; v < views; ++v) {
      capture.train.push_back(
          {std::to_string(v), 0,
           camera_at({is_right ? 0.5F * static_cast<float>(v) : -0.5F * static_cast<float>(v), 0, 0})});
      for (int64_t n = 0; n < points; ++n) {
        const float depth = 3 + 0.01F * static_cast<float>(n);
        capture.tracks.direction(v, n, 0) = (0.3F - 0.5F * static_cast<float>(v)) / depth;
        capture.tracks.direction(v, n, 1) = 0.001F * static_cast<float>(n) / depth;
      }
    }
    std::vector<ViewFacts> facts(views);
    for (size_t v = 0; v < views; ++v) facts[v].view = &capture.train[v];
    Findings findings;
    EXPECT_EQ(check_tracks(capture, facts, findings).agreeing, is_right ? 1 : 0);
    EXPECT_EQ(findings.size(), is_right ? 0U : 1U);
  }
}

// A camera that only turns sees each point at one place, wherever it is.
TEST(TrackChecks, CamerasAtOnePlaceAreCompared) {
  for (const float error : {0.0F, 0.1F}) {
    Capture capture;
    constexpr int64_t points = 200;
    capture.tracks = {Tensor<float>({2, points, 2}), Tensor<uint8_t>({2, points})};
    capture.tracks.seen.fill(1);
    for (const float angle : {0.0F, 0.3F}) {
      Camera<float> camera = camera_at({1, 2, 3});
      camera.camera_from_world =
          Mat3<float>(std::cos(angle), 0, std::sin(angle), 0, 1, 0, -std::sin(angle), 0, std::cos(angle));
      const auto v = static_cast<int64_t>(capture.train.size());
      capture.train.push_back({std::to_string(v), 0, camera});
      for (int64_t n = 0; n < points; ++n) {
        const Vec3<float> x = camera.camera_from_world * Vec3<float>(0.002F * static_cast<float>(n), 0.1F, 1);
        capture.tracks.direction(v, n, 0) = x.x / x.z + (v == 1 ? error : 0);
        capture.tracks.direction(v, n, 1) = x.y / x.z;
      }
    }
    std::vector<ViewFacts> facts(2);
    for (size_t v = 0; v < 2; ++v) facts[v].view = &capture.train[v];
    Findings findings;
    EXPECT_EQ(check_tracks(capture, facts, findings).agreeing, error == 0 ? 1 : 0);
  }
}

}  // namespace
}  // namespace traceflow
