#include "eval/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace traceflow::eval {
namespace {

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
      R"({"capture":"kettle","split":"test","downscale":2,"device":"cpu","iterations":100,"train_seconds":1.5,)"
      R"("render_fps":null,"surfels":{"main":7,"environment":0},"mean":{"psnr":21.5,)" +
          rest + R"(,"views":[{"id":"000","psnr":20.0,)" + rest + R"(,{"id":"001","psnr":23.0,)" + rest +
          "]}");
  EXPECT_THAT(report_table(report), testing::HasSubstr("21.50"));
}

}  // namespace
}  // namespace traceflow::eval
