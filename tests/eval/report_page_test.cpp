#include "eval/report_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/random.h"

namespace traceflow::eval {
namespace {

using Json = nlohmann::json;

const std::string before = R"(<script type="application/json" id="report">)";

// The page's data as a browser finds it: up to the first "</script" or "<!--" after the element begins.
Json data_of(const std::string& html) {
  const size_t begin = html.find(before);
  EXPECT_NE(begin, std::string::npos);
  const size_t from = begin + before.size();
  const size_t end = html.find('<', from);
  EXPECT_EQ(html.compare(end, 9, "</script>"), 0) << html.substr(end, 40);
  return Json::parse(html.substr(from, end - from));
}

ReportPage some_page() {
  ReportPage page;
  page.version = "1.2.3";
  page.made = "2026-01-02T03:04:05Z";
  page.run = "run";
  page.machine = {"chip", 4, 8192, "Linux", "card"};
  page.report.capture = "kettle";
  page.report.split = "test";
  page.report.device = "cuda";
  page.report.iterations = 7;
  page.report.render_fps = 2.5;
  page.report.main_surfels = 3;
  Metrics metrics;
  metrics.psnr = 20;
  page.report.views = {{"000", metrics, 0.25F}, {"001", {}, 1}};
  page.settings = {{"loss.normal", "0.5", "0", "dB", "What it does."}};
  page.phases = {{"diffuse", 1, 5, 2.5, {{"raster", 5, 1.5}}}};
  page.events = {R"({"event":"step","iteration":5,"loss":null})"};
  page.pictures = {{"000", 8, 4, "a", "b", "c", "d", "e", "f", "g"}};
  return page;
}

TEST(ReportPage, HoldsTheDataOfTheContract) {
  const std::string metrics =
      R"("ssim":null,"lpips":null,"lpips_published":null,"masked_psnr":null,"masked_ssim":null,"core_psnr":null,
         "normal_mae_deg":null,"masked_normal_mae_deg":null,"masked_depth_error_median":null,
         "masked_depth_error_mean":null,"core_depth_error_median":null,"core_depth_error_mean":null,
         "outside_depth_error_median":null,"outside_depth_error_mean":null})";
  EXPECT_EQ(
      data_of(report_page(some_page())), Json::parse(R"({"version":"1.2.3","made":"2026-01-02T03:04:05Z",
    "run":"run","capture":"kettle","split":"test","downscale":1,"device":"cuda",
    "machine":{"processor":"chip","threads":4,"memory_bytes":8192,"system":"Linux","gpu":"card"},
    "iterations":7,"train_seconds":0.0,"render_fps":2.5,"surfels":{"main":3,"environment":0,"per_masked_pixel":null},
    "mean":{"psnr":20.0,)" + metrics + R"(,"motion":null,
    "views":[{"id":"000","time":0.25,"psnr":20.0,)" + metrics +
                                                     R"(,{"id":"001","time":1.0,"psnr":null,)" + metrics +
                                                     R"(],
    "settings":[{"path":"loss.normal","value":"0.5","default":"0","unit":"dB","help":"What it does."}],
    "phases":[{"name":"diffuse","first":1,"last":5,"seconds":2.5,"steps":[{"name":"raster","calls":5,"seconds":1.5}]}],
    "events":[{"event":"step","iteration":5,"loss":null}],
    "pictures":[{"id":"000","width":8,"height":4,"photograph":"a","rgb":"b","difference":"c","diffuse":"d",
      "specular":"e","normal":"f","depth":"g"}]})"));
}

TEST(ReportPage, NoNameOrTextEndsTheScript) {
  for (const std::string& evil :
       {std::string("</script><script>alert(1)</script>"), std::string("<!--<script>"),
        std::string("\"]},</SCRIPT "), std::string("\xff\xfe</script>"), std::string("\0<", 2),
        std::string("\\u003c/script>\n\u2028")}) {
    ReportPage page = some_page();
    page.run = page.version = page.report.capture = page.report.views[0].id = page.machine.processor = evil;
    page.settings[0].value = page.phases[0].name = page.phases[0].steps[0].name = page.pictures[0].id = evil;
    page.events = {Json({{"event", "warning"}, {"iteration", 0}, {"text", evil}})
                       .dump(-1, ' ', false, Json::error_handler_t::replace),
                   "</script>", "not JSON", "[]"};
    const std::string html = report_page(page);
    const Json data = data_of(html);
    EXPECT_EQ(data["events"].size(), 1U);
    if (static_cast<unsigned char>(evil[0]) < 0x80) {
      for (const Json& text :
           {data["run"], data["capture"], data["views"][0]["id"], data["phases"][0]["name"],
            data["events"][0]["text"], data["pictures"][0]["id"]}) {
        EXPECT_EQ(text, evil);
      }
    }
  }
}

TEST(ReportPage, NumbersThatAreNoneBecomeNull) {
  ReportPage page = some_page();
  page.report.train_seconds = std::nan("");
  page.phases[0].seconds = std::numeric_limits<double>::infinity();
  const Json data = data_of(report_page(page));
  EXPECT_TRUE(data["train_seconds"].is_null());
  EXPECT_TRUE(data["phases"][0]["seconds"].is_null());
}

TEST(ReportPage, ATemplateWithoutOnePlaceIsABug) {
  EXPECT_THROW(report_page(some_page(), "<html>"), InternalError);
  EXPECT_THROW(report_page(some_page(), before + "null</script>" + before + "null</script>"), InternalError);
  EXPECT_EQ(data_of(report_page(some_page(), "x" + before + "null</script>y"))["run"], "run");
}

TEST(ReportPage, StaysUnderFifteenMegabytes) {
  ReportPage page = some_page();
  for (int i = 0; i < 30; ++i)
    page.pictures.push_back({"x", 1, 1, std::string(1'000'000, 'p'), "", "", "", "", "", ""});
  const std::string html = report_page(page);
  EXPECT_LE(html.size(), 15'000'000U);
  EXPECT_GE(data_of(html)["pictures"].size(), 14U);
  std::string text(1000, 'w');
  while (text.size() < 14'400'000) text += text;
  text.resize(14'400'000);
  page.events = {R"({"event":"warning","iteration":1,"text":")" + text + R"("})"};
  EXPECT_EQ(data_of(report_page(page))["pictures"].size(), 1U) << "the small one";
}

// Noise, which JPEG cannot compress.
Frame noisy_frame(int64_t height, int64_t width, Tensor<float>& photograph) {
  Random random(1);
  const auto noise = [&](const Shape& shape) {
    Tensor<float> t(shape);
    for (float& v : t.values()) v = static_cast<float>(random.uniform());
    return t;
  };
  const Shape colour{height, width, 3}, grey{height, width};
  photograph = noise(colour);
  Frame frame;
  frame.colour = noise(colour);
  frame.raster.colour = noise(colour);
  frame.raster.normal = noise(colour);
  frame.raster.depth = noise(grey);
  return frame;
}

size_t bytes_of(const ReportPicture& p) {
  return p.photograph.size() + p.rgb.size() + p.difference.size() + p.diffuse.size() + p.specular.size() +
         p.normal.size() + p.depth.size();
}

TEST(ReportPictures, ManyLargeViewsKeepToTheBudget) {
  Tensor<float> photograph;
  const Frame frame = noisy_frame(900, 1600, photograph);
  constexpr size_t budget = 1'000'000, views = 1000;
  ReportPictures pictures(views, budget);
  size_t added = 0;
  for (size_t i = 0; i < views; ++i) {
    if (!pictures.wants(i)) continue;
    ++added;
    if (added <= 2) pictures.add(std::to_string(i), photograph, frame);
  }
  EXPECT_EQ(added, 12U);
  for (const ReportPicture& p : pictures.take()) {
    EXPECT_LE(bytes_of(p), budget / 12);
    EXPECT_GT(bytes_of(p), budget / 12 / 4);
    EXPECT_NEAR(static_cast<double>(p.width) / static_cast<double>(p.height), 16.0 / 9, 0.05);
    EXPECT_TRUE(p.depth.starts_with("data:image/jpeg;base64,/9j/"));
  }
}

TEST(ReportPictures, OddShapesAreNoError) {
  for (const auto& [height, width] : std::vector<std::pair<int64_t, int64_t>>{{1, 1}, {3000, 2}, {2, 3000}}) {
    Tensor<float> photograph;
    const Frame frame = noisy_frame(height, width, photograph);
    ReportPictures pictures(1);
    EXPECT_TRUE(pictures.wants(0));
    pictures.add("a", photograph, frame);
    const auto made = pictures.take();
    ASSERT_EQ(made.size(), 1U);
    EXPECT_GE(made[0].width, 1);
    EXPECT_LE(made[0].width, 1280);
  }
  EXPECT_FALSE(ReportPictures(0).wants(0));
}

RC_GTEST_PROP(ReportPictures, spread_views_are_as_many_as_wanted, ()) {
  const auto n = *rc::gen::inRange<size_t>(0, 300), wanted = *rc::gen::inRange<size_t>(0, 40);
  size_t count = 0;
  for (size_t i = 0; i < n; ++i) count += among_spread(i, n, wanted) ? 1 : 0;
  RC_ASSERT(count == std::min(n, wanted));
}

}  // namespace
}  // namespace traceflow::eval
