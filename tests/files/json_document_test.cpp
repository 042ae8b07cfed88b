#include "files/json_document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>

#include "base/error.h"
#include "support/refusal.h"

namespace traceflow {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

using Read = std::function<void(const JsonField&)>;

std::string refusal(const std::string& text, const Read& read) {
  return refusal_of([&] {
    const JsonDocument document("file", text);
    read(document);
  });
}

TEST(JsonDocument, ReadsWhatStandsThere) {
  const JsonDocument d(
      "file", R"({"a": {"b": [1, 2.5, -3]}, "w": 7, "t": "word", "y": true, "n": null, "i": ["x", 4]})");
  EXPECT_THAT(d["a"]["b"].numbers(3), ElementsAre(1, 2.5, -3));
  EXPECT_EQ(d["a"]["b"].vector(), Vec3<double>(1, 2.5, -3));
  EXPECT_EQ(d["a"]["b"].elements().size(), 3U);
  EXPECT_EQ(d["w"].whole(0, 7), 7);
  EXPECT_EQ(d["w"].number(7, 8), 7);
  EXPECT_EQ(d["t"].text(4), "word");
  EXPECT_TRUE(d["y"].yes());
  EXPECT_FALSE(d.has("n"));
  EXPECT_FALSE(d["w"].has("a"));
  EXPECT_THAT(d["i"].strings(), ElementsAre("x", "4"));
}

TEST(JsonDocument, RefusesByName) {
  const std::vector<std::tuple<const char*, Read, const char*>> cases = {
      {"{", [](auto&) {}, "file: byte 2: found text that is not JSON"},
      {"", [](auto&) {}, "not JSON"},
      {"{\"a\": 1e400}", [](auto&) {}, "beyond double precision"},
      {"\"\xFF\"", [](auto&) {}, "not JSON"},
      {"[]", [](auto& d) { d["a"]; }, "file: found [], expected an object"},
      {"{}", [](auto& d) { d["a"]; }, "file: a: found nothing, expected a value"},
      {"{\"a\": null}", [](auto& d) { d["a"]; }, "file: a: found nothing"},
      {"{\"a\": {\"b\": \"1\"}}", [](auto& d) { d["a"]["b"].number(); },
       "file: a.b: found \"1\", expected a finite"},
      {"{\"a\": 2}", [](auto& d) { d["a"].number(0, 1); }, "file: a: found 2, expected 0 to 1"},
      {"{\"a\": 0}", [](auto& d) { d["a"].positive(); }, "above zero"},
      {"{\"a\": 0.5}", [](auto& d) { d["a"].whole(0, 1); }, "found 0.5, expected a whole number, 0 to 1"},
      {"{\"a\": 1e300}", [](auto& d) { d["a"].whole(0, 1); }, "a whole number"},
      {"{\"a\": true}", [](auto& d) { d["a"].whole(0, 1); }, "a whole number"},
      {"{\"a\": 1}", [](auto& d) { d["a"].yes(); }, "true or false"},
      {"{\"a\": 1}", [](auto& d) { d["a"].text(); }, "a string"},
      {"{\"a\": \"abc\"}", [](auto& d) { d["a"].text(2); }, "found 3 bytes, expected a string of at most 2"},
      {"{\"a\": [1, 2]}", [](auto& d) { d["a"].numbers(3); }, "found [1,2], expected a list of 3"},
      {"{\"a\": [1, 2, \"x\"]}", [](auto& d) { d["a"].numbers(3); }, "file: a[2]: found \"x\""},
      {"{\"a\": [1, 2, 1e16]}", [](auto& d) { d["a"].vector(); }, "file: a[2]: found 1e+16"},
      {"{\"a\": {}}", [](auto& d) { d["a"].elements(); }, "a list"},
      {"{\"a\": [[]]}", [](auto& d) { d["a"].strings(); }, "file: a[0]: found [], expected a string"},
  };
  for (const auto& [text, read, words] : cases) EXPECT_THAT(refusal(text, read), HasSubstr(words)) << text;
}

TEST(JsonDocument, TakesTheNearestRotation) {
  const JsonDocument d("file", "[[0, -1, 0], [1.004, 0, 0], [0, 0, 0.998]]");
  const Mat3<double> r = d.rotation();
  EXPECT_NEAR(r[0][1], 1, 1e-12);  // the second row's first number
  EXPECT_NEAR(r[1][0], -1, 1e-12);
  EXPECT_NEAR(r[2][2], 1, 1e-12);
  for (const char* text : {"[[0,0,0],[0,0,0],[0,0,0]]", "[[1,0,0],[0,1.02,0],[0,0,1]]",
                           "[[1,0,0],[0,1,0],[0,0,-1]]", "[[1,0,0],[0,1,0]]", "[1,0,0,0,1,0,0,0,1]"}) {
    EXPECT_NE(refusal(text, [](const JsonField& f) { (void)f.rotation(); }), "accepted") << text;
  }
}

TEST(JsonDocument, HoldsDepthToALimit) {
  const auto nest = [](int depth) {
    return std::string(static_cast<size_t>(depth), '[') + std::string(static_cast<size_t>(depth), ']');
  };
  EXPECT_EQ(refusal(nest(64), [](auto&) {}), "accepted");
  EXPECT_THAT(refusal(nest(65), [](auto&) {}), HasSubstr("64 deep"));
  EXPECT_THAT(refusal(std::string(1 << 20, '['), [](auto&) {}), HasSubstr("64 deep"));
  EXPECT_EQ(refusal("\"" + std::string(100, '[') + "\\\"[\"", [](auto&) {}), "accepted");
}

TEST(JsonDocument, HoldsListsToALimit) {
  const auto list = [](size_t count) {
    std::string text = "[0";
    for (size_t i = 1; i < count; ++i) text += ",0";
    return text + "]";
  };
  EXPECT_EQ(refusal(list(1'000'000), [](auto& d) { d.strings(); }), "accepted");
  EXPECT_EQ(refusal(list(1'000'001), [](auto& d) { d.strings(); }),
            "file: found 1000001 elements, expected 1000000 at most");
}

TEST(JsonDocument, HoldsValuesToALimit) {
  const auto list = [](size_t count) {
    std::string text = "[{}";
    for (size_t i = 1; i < count; ++i) text += ",{}";
    return text + "]";
  };
  EXPECT_EQ(json_extent(list(1'999'999)).values, max_json_values - 1);
  EXPECT_EQ(refusal(list(2'000'000), [](auto&) {}), "file: found 4000001 values, expected at most 4000000");
  EXPECT_EQ(refusal("\"" + std::string(5'000'000, ',') + "\"", [](auto&) {}), "accepted");
}

TEST(JsonDocument, TheCamerasOfALongFilmAreFarFromTheLimit) {
  const std::string frame =
      R"({"file_path": "images/000001.png", "time": 0.5, "fl_x": 1, "fl_y": 1, "cx": 1, "cy": 1, "w": 1, "h": 1,)"
      R"( "k1": 0, "k2": 0, "k3": 0, "p1": 0, "p2": 0, "colmap_im_id": 1, "transform_matrix":)"
      R"( [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]})";
  constexpr size_t frames = 10'000;
  EXPECT_LT(frames * json_extent(frame).values, max_json_values / 5);
}

TEST(JsonDocument, QuotesOnlyTheBeginningOfWhatItFound) {
  const std::string message =
      refusal("[\"" + std::string(1000, 'x') + "\"]", [](const JsonField& f) { (void)f.number(); });
  EXPECT_LT(message.size(), 150U);
  EXPECT_THAT(message, HasSubstr("xxx…"));
}

TEST(JsonFile, NamesTheFile) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "json_document_test.json";
  std::ofstream(path) << "{\"a\": 1}";
  EXPECT_EQ(JsonFile(path)["a"].number(), 1);
  std::filesystem::resize_file(path, (int64_t{64} << 20) + 1);
  try {
    const JsonFile file(path);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("json_document_test.json: found 67108865 bytes"));
  }
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace traceflow
