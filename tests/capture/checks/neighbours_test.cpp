#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "capture/checks/checks.h"
#include "capture/image_cache.h"

namespace traceflow {
namespace {

// A film in which nothing moves, 1.png to 12.png: each picture is a little brighter than the one before, and
// the tenth much.
TEST(Neighbours, of_one_time_stand_in_the_order_of_their_numbers) {
  Capture capture;
  std::unordered_map<std::string, ViewSource> sources;
  for (int number = 1; number <= 12; ++number) {
    capture.train.push_back({std::to_string(number), 0, {}});
    sources.emplace(capture.train.back().id, ViewSource{});
  }
  capture.images = std::make_shared<ImageCache>(std::move(sources), CaptureSource{}, 0);
  std::vector<ViewFacts> facts(capture.train.size());
  for (size_t i = 0; i < facts.size(); ++i) {
    facts[i].view = &capture.train[i];
    facts[i].exposure = 0.1 * static_cast<double>(i) + (i < 9 ? 0 : 2);
    facts[i].sharpness = 1;
    facts[i].thumbnail = Tensor<uint8_t>({2, 2});
    facts[i].thumbnail.fill(static_cast<uint8_t>(10 * i));
  }
  Findings findings;
  check_neighbours(capture, facts, findings);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].kind, "exposure-jump");
  EXPECT_THAT(findings[0].views, testing::ElementsAre("10"));
  EXPECT_NEAR(*findings[0].value, 2.1, 1e-9);
}

}  // namespace
}  // namespace traceflow
