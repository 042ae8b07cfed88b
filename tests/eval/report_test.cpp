#include "eval/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "capture/synth/synth.h"
#include "files/npy.h"
#include "scene/viewpoint.h"
#include "support/temp_folder.h"

namespace traceflow::eval {
namespace {

// Disks of one grey where the capture has points.
Scene scene_of(const Capture& capture) {
  Scene scene;
  scene.specular = Specular::none;
  scene.normalisation = capture.normalisation;
  scene.extent = capture.extent;
  Surfels& s = scene.main;
  const int64_t count = capture.points.dim(0);
  s.position = capture.points;
  s.log_scale.reset({count, 2});
  s.log_scale.fill(std::log(0.05F));
  s.rotation.reset({count, 4});
  for (int64_t i = 0; i < count; ++i) s.rotation(i, 0) = 1;
  s.opacity_logit.reset({count});
  s.opacity_logit.fill(2);
  s.sh.reset({count, 1, 3});
  s.tint_logit.reset({count});
  s.tint_logit.fill(-9);
  return scene;
}

double psnr_of(const viz::Subject& subject, const Capture& capture) {
  Report report;
  evaluate(subject, capture, capture.train, nullptr, {}, report);
  return *mean_of(report).psnr;
}

TEST(Report, HasTheKeysThatScriptsReadAndNullWhereAFigureCannotBeHad) {
  Report report;
  report.capture = "kettle";
  report.split = "test";
  report.downscale = 2;
  report.iterations = 100;
  report.train_seconds = 1.5;
  report.main_surfels = 7;
  Metrics metrics;
  metrics.psnr = 20;
  report.views = {{"000", metrics, 0}, {"001", metrics, 0.5F}};
  metrics.psnr = 23;
  report.views[1].metrics = metrics;
  const std::string text = report_json(report);
  std::string compact;
  for (const char c : text) {
    if (c != ' ' && c != '\n') compact += c;
  }
  const std::string rest =
      R"("ssim":null,"lpips":null,"lpips_published":null,"masked_psnr":null,"masked_ssim":null,"core_psnr":null,)"
      R"("normal_mae_deg":null,"masked_normal_mae_deg":null,"masked_depth_error_median":null,)"
      R"("masked_depth_error_mean":null,"core_depth_error_median":null,"core_depth_error_mean":null,)"
      R"("outside_depth_error_median":null,"outside_depth_error_mean":null})";
  EXPECT_EQ(
      compact,
      R"({"capture":"kettle","split":"test","views_as_trained":true,"downscale":2,"device":"cpu","iterations":100,"train_seconds":1.5,)"
      R"("render_fps":null,"surfels":{"main":7,"environment":0,"per_masked_pixel":null},"mean":{"psnr":21.5,)" +
          rest + R"(,"motion":null,"views":[{"id":"000","time":0.0,"psnr":20.0,)" + rest +
          R"(,{"id":"001","time":0.5,"psnr":23.0,)" + rest + "]}");
}

TEST(Report, TheTableHasAColumnForWhatSomeViewHasAndLinesOfTheMotion) {
  Report report;
  Metrics metrics;
  metrics.psnr = 20;
  metrics.core_depth_error_median = 0.0123;
  report.views = {{"000", metrics}, {"001", {}}};
  EXPECT_EQ(report_table(report),
            "view        PSNR   cdepth%\n"
            "000        20.00      1.23\n"
            "001            -         -\n"
            "mean       20.00      1.23\n");
  report.aligned = metrics;
  EXPECT_EQ(report_table(report),
            "view          PSNR   cdepth%\n"
            "000          20.00      1.23\n"
            "001              -         -\n"
            "mean         20.00      1.23\n"
            "aligned      20.00      1.23\n");
  report.motion.emplace();
  report.motion->objects = {{1, 9, 8, {0.5, 0.1, 0.2, 3.0, 0.9, 1.0}, {}}, {4, 7, 2, {}, {}}};
  report.motion->mean = report.motion->objects[0].figures;
  EXPECT_THAT(
      report_table(report),
      ::testing::EndsWith("motion, in capture units; in brackets missed by moved, 1 = not followed\n"
                          "  object 1: 8 of 9 points have surfels: moves 0.500, missed by 0.100 (0.20), "
                          "rotation off by 3.0°, scale 0.90 (true 1.00)\n"
                          "  object 4: 2 of 7 points have surfels: not followed\n"
                          "  mean: moves 0.500, missed by 0.100 (0.20), rotation off by 3.0°, scale 0.90 "
                          "(true 1.00)\n"));
}

TEST(Report, MotionIsGivenByObjectAndTime) {
  Report report;
  report.motion.emplace();
  report.motion->objects = {
      {1, 9, 8, {0.5, 0.1, 0.2, 3.0, 0.9, 1.0}, {{0, 0, 0, 0.0, 0, 1, 1}, {1, 0.5, 0.1, 0.2, 3, 0.9, 1}}},
      {4, 7, 2, {}, {}}};
  report.motion->mean = report.motion->objects[0].figures;
  const nlohmann::json motion = nlohmann::json::parse(report_json(report))["motion"];
  const std::string figures =
      R"("moved":0.5,"missed":0.1,"share":0.2,"rotation_error_deg":3.0,"scale":0.9,"true_scale":1.0)";
  EXPECT_EQ(motion,
            nlohmann::json::parse(
                R"({"mean":{)" + figures + R"(},"objects":[{"object":1,"points":9,"followed_points":8,)" +
                figures + R"(,"curve":[{"time":0.0,"moved":0.0,"missed":0.0,"share":0.0,)" +
                R"("rotation_error_deg":0.0,"scale":1.0,"true_scale":1.0},{"time":1.0,)" + figures +
                R"(}]},{"object":4,"points":7,"followed_points":2,"moved":null,"missed":null,"share":null,)" +
                R"("rotation_error_deg":null,"scale":null,"true_scale":null,"curve":[]}]})"));
}

void write_small_capture(const std::filesystem::path& folder) {
  SynthOptions synth;
  synth.frames = 4;
  synth.width = 60;
  synth.height = 36;
  synth.samples = 2;
  synth.points = 400;
  write_synthetic_capture(synth, folder);
}

// The files' own numbers against the picture's, inside the mask.
TEST(Evaluate, DepthErrorsAreThoseOfTheCapturesFiles) {
  const TempFolder folder;
  write_small_capture(folder / "capture");
  const Capture capture = load_capture(folder / "capture", {});
  const viz::Subject subject{scene_of(capture), {}, {}, ""};
  Report report;
  std::map<std::string, double> expected;
  evaluate(
      subject, capture, capture.test, nullptr,
      [&](const View& view, const ViewImages& images, const Frame& frame) {
        const Tensor<float> truth = read_npy(folder / "capture/truth/depth" / (view.id + ".npy"));
        double sum = 0;
        int count = 0;
        for (int64_t i = 0; i < truth.size(); ++i) {
          if (images.mask[i] == 0 || !(truth[i] > 0)) continue;
          const double z = frame.raster.alpha[i] < 0.5F ? 0 : static_cast<double>(frame.raster.depth[i]);
          sum += std::abs(z / capture.normalisation.scale / static_cast<double>(truth[i]) - 1);
          ++count;
        }
        expected[view.id] = sum / count;
      },
      report);
  ASSERT_FALSE(report.views.empty());
  for (const ViewReport& view : report.views) {
    EXPECT_GT(expected.at(view.id), 0.001);
    EXPECT_NEAR(*view.metrics.masked_depth_error_mean, expected.at(view.id), 1e-5);
    EXPECT_TRUE(view.metrics.masked_depth_error_median && view.metrics.outside_depth_error_median);
  }
  EXPECT_TRUE(report.motion);
}

TEST(Evaluate, WithoutTrueMotionThereIsNone) {
  const TempFolder folder;
  write_small_capture(folder / "capture");
  std::filesystem::remove_all(folder / "capture/truth/motion");
  const Capture capture = load_capture(folder / "capture", {});
  const viz::Subject subject{scene_of(capture), {}, {}, ""};
  Report report;
  evaluate(subject, capture, capture.test, nullptr, {}, report);
  EXPECT_FALSE(report.motion);
}

TEST(Evaluate, DepthErrorsAreTheSameInACaptureThatIsNormalisedAnew) {
  const TempFolder folder;
  write_small_capture(folder / "capture");
  const Capture capture = load_capture(folder / "capture", {});
  const viz::Subject subject{scene_of(capture), {}, {}, ""};
  Report before, after;
  evaluate(subject, capture, capture.test, nullptr, {}, before);
  nlohmann::json scene = nlohmann::json::parse(std::ifstream(folder / "capture/scene.json"));
  scene["scale"] = 2.5 * scene["scale"].get<double>();
  std::ofstream(folder / "capture/scene.json") << scene;
  const Capture anew = load_capture(folder / "capture", {});
  ASSERT_NE(anew.normalisation, capture.normalisation);
  evaluate(subject, anew, anew.test, nullptr, {}, after);
  EXPECT_NEAR(*mean_of(after).outside_depth_error_median, *mean_of(before).outside_depth_error_median, 1e-4);
  EXPECT_NEAR(*mean_of(after).masked_depth_error_mean, *mean_of(before).masked_depth_error_mean, 1e-4);
}

// The scene has a surfel at each of the points and stands still.
TEST(Evaluate, MotionIsMeasuredInTheCapturesOwnUnits) {
  const TempFolder folder;
  write_small_capture(folder / "capture");
  const Capture without = load_capture(folder / "capture", {});
  const viz::Subject subject{scene_of(without), {}, {}, ""};
  Tensor<float> points({3, 20, 3}), object({20});
  for (int64_t t = 0; t < 3; ++t) {
    for (int64_t i = 0; i < 20; ++i) {
      const auto x = without.normalisation.in_capture(load3<double>(without.points.row(i)));
      store3(&points(t, i, 0), x + Vec3<double>(0, 0.5 * static_cast<double>(t), 0));
    }
  }
  object.fill(6);
  std::filesystem::create_directories(folder / "capture/truth/motion");
  write_npy(folder / "capture/truth/motion/points.npy", points);
  write_npy(folder / "capture/truth/motion/object.npy", object);
  Report report;
  const Capture capture = load_capture(folder / "capture", {});
  evaluate(subject, capture, capture.test, nullptr, {}, report);
  ASSERT_TRUE(report.motion);
  EXPECT_EQ(report.motion->objects.at(0).object, 6);
  EXPECT_EQ(report.motion->objects[0].followed_points, 20);
  EXPECT_NEAR(*report.motion->mean.share, 1, 1e-9);
  EXPECT_NEAR(report.motion->objects[0].curve.back().missed, 1, 1e-5);
  std::filesystem::remove(folder / "capture/truth/motion/object.npy");
  const Capture broken = load_capture(folder / "capture", {});
  EXPECT_THROW(evaluate(subject, broken, broken.test, nullptr, {}, report), InputError);
}

// A capture that has gained a view, or lost one, is normalised anew: the scene stays as it was trained.
TEST(Evaluate, TheSceneIsSeenFromWhereItStands) {
  const TempFolder folder;
  SynthOptions synth;
  synth.frames = 3;
  synth.width = 40;
  synth.height = 24;
  synth.samples = 2;
  synth.points = 200;
  write_synthetic_capture(synth, folder / "capture");
  const Capture capture = load_capture(folder / "capture", {});
  const viz::Subject subject{scene_of(capture), {}, {}, ""};
  const double psnr = psnr_of(subject, capture);

  Capture normalised_anew = capture;
  normalised_anew.normalisation = {capture.normalisation.centre + Vec3<double>(1, 2, 3),
                                   2.5 * capture.normalisation.scale};
  for (View& view : normalised_anew.train)
    view.camera = renormalised(view.camera, capture.normalisation, normalised_anew.normalisation);
  EXPECT_NEAR(psnr_of(subject, normalised_anew), psnr, 1e-3);
}

}  // namespace
}  // namespace traceflow::eval
