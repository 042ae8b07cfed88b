#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "capture/capture.h"
#include "capture/image_cache.h"
#include "support/refusal.h"

// What tests of readers ask of a capture that was read.
namespace traceflow {

// A finding with this in its text.
inline auto says(const std::string& part) {
  return testing::Field("text", &Finding::text, testing::HasSubstr(part));
}

// A finding of this kind with this in its text.
inline auto tells(const std::string& kind, Severity severity, const std::string& part) {
  return testing::AllOf(says(part), testing::Field("kind", &Finding::kind, kind),
                        testing::Field("severity", &Finding::severity, severity));
}

inline std::vector<std::string> ids(const std::vector<View>& views) {
  std::vector<std::string> result(views.size());
  std::transform(views.begin(), views.end(), result.begin(), [](const View& view) { return view.id; });
  return result;
}

inline std::string refusal(const std::filesystem::path& path, const CaptureOptions& options = {}) {
  return refusal_of([&] { load_capture(path, options); });
}

inline void expect_pixels(const Capture& capture, const View& view, const Tensor<uint8_t>& expected,
                          double tolerance) {
  const auto images = load_images(capture, view);
  ASSERT_EQ(images->colour.shape(), (Shape{expected.dim(0), expected.dim(1), 3}));
  for (int64_t i = 0; i < images->colour.size(); ++i)
    ASSERT_NEAR(255 * images->colour[i], expected[i], tolerance) << i;
}

// Everything that a reader found, as one text: two ways of giving a capture must agree in it.
inline std::string summary(const Capture& c) {
  std::string text = c.format;
  for (const auto* split : {&c.train, &c.test}) {
    for (const View& view : *split) {
      const auto& k = view.camera;
      text += "\n" + view.id + " " + std::to_string(view.time) + " " + std::to_string(k.focal_x) + " " +
              std::to_string(k.centre_y) + " " + std::to_string(k.position.x) + " " +
              std::to_string(k.position.y);
    }
  }
  return text + "\n" + std::to_string(c.points.size()) + " " + std::to_string(c.normalisation.scale);
}

}  // namespace traceflow
