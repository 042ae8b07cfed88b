#include "eval/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "capture/synth/synth.h"
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

double psnr_of(const show::Subject& subject, const Capture& capture) {
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
  report.views = {{"000", metrics}, {"001", metrics}};
  metrics.psnr = 23;
  report.views[1].metrics = metrics;
  const std::string text = report_json(report);
  std::string compact;
  for (const char c : text) {
    if (c != ' ' && c != '\n') compact += c;
  }
  const std::string rest =
      R"("ssim":null,"lpips":null,"lpips_published":null,"masked_psnr":null,"masked_ssim":null,)"
      R"("normal_mae_deg":null,"masked_normal_mae_deg":null})";
  EXPECT_EQ(
      compact,
      R"({"capture":"kettle","split":"test","views_as_trained":true,"downscale":2,"device":"cpu","iterations":100,"train_seconds":1.5,)"
      R"("render_fps":null,"surfels":{"main":7,"environment":0},"mean":{"psnr":21.5,)" +
          rest + R"(,"views":[{"id":"000","psnr":20.0,)" + rest + R"(,{"id":"001","psnr":23.0,)" + rest +
          "]}");
  EXPECT_THAT(report_table(report), ::testing::HasSubstr("21.50"));
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
  const show::Subject subject{scene_of(capture), {}, {}, ""};
  const double psnr = psnr_of(subject, capture);

  Capture normalised_anew = capture;
  normalised_anew.normalisation = {capture.normalisation.centre + Vec3<double>(1, 2, 3),
                                   2.5 * capture.normalisation.scale};
  for (View& view : normalised_anew.train)
    view.camera = carried(view.camera, capture.normalisation, normalised_anew.normalisation);
  EXPECT_NEAR(psnr_of(subject, normalised_anew), psnr, 1e-3);
}

}  // namespace
}  // namespace traceflow::eval
