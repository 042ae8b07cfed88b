#include "splat/ply.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

#include "splat/random_surfels.h"
#include "support/refusal.h"

namespace traceflow {
namespace {

using testing::HasSubstr;

class Ply : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("traceflow-ply-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    file_ = folder_ / "scene.ply";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void write(const std::string& bytes) const { std::ofstream(file_, std::ios::binary) << bytes; }
  std::string bytes() const {
    std::ostringstream text;
    text << std::ifstream(file_, std::ios::binary).rdbuf();
    return text.str();
  }
  // The message of the InputError that reading the file throws; empty when it throws none.
  std::string refusal() const {
    return refusal_of([&] { read_ply(file_); });
  }

  std::filesystem::path folder_, file_;
};

void expect_equal(const Surfels& a, const Surfels& b) {
  const auto equal = [](const Tensor<float>& x, const Tensor<float>& y) {
    return x.shape() == y.shape() && std::equal(x.data(), x.data() + x.size(), y.data());
  };
  EXPECT_TRUE(equal(a.position, b.position));
  EXPECT_TRUE(equal(a.log_scale, b.log_scale));
  EXPECT_TRUE(equal(a.rotation, b.rotation));
  EXPECT_TRUE(equal(a.opacity_logit, b.opacity_logit));
  EXPECT_TRUE(equal(a.sh, b.sh));
  EXPECT_TRUE(equal(a.tint_logit, b.tint_logit));
  EXPECT_TRUE(equal(a.roughness_logit, b.roughness_logit));
}

// A body of `count` floats 0, 1, 2, … after a header with these property lines.
std::string file_of(const std::vector<std::string>& names, int vertices) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(vertices) + "\n";
  for (const std::string& name : names) text += "property float " + name + "\n";
  text += "end_header\n";
  for (int i = 0; i < vertices * static_cast<int>(names.size()); ++i) {
    const auto value = static_cast<float>(i);
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  return text;
}

const std::vector<std::string> degree_0 = {"x",      "y",       "z",       "f_dc_0",  "f_dc_1",
                                           "f_dc_2", "opacity", "scale_0", "scale_1", "rot_0",
                                           "rot_1",  "rot_2",   "rot_3"};

TEST_F(Ply, RoundTripKeepsEveryBit) {
  for (const int64_t coefficients : {1, 4, 9, 16}) {
    for (const bool tint : {false, true}) {
      const PlyScene scene = {random_surfels(5000, coefficients, tint),
                              {{"extent", "2.5"}, {"environment", "environment.ply"}}};
      write_ply(file_, scene);
      const PlyScene back = read_ply(file_);
      expect_equal(back.surfels, scene.surfels);
      EXPECT_EQ(back.notes, scene.notes);
    }
  }
}

TEST_F(Ply, EmptySetRoundTrips) {
  write_ply(file_, {random_surfels(0, 16, true), {}});
  EXPECT_EQ(read_ply(file_).surfels.count(), 0);
}

TEST_F(Ply, WritesTheAttributesOf2dgsInTheirOrder) {
  write_ply(file_, {random_surfels(1, 4, true), {}});
  EXPECT_THAT(bytes(), HasSubstr("element vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
                                 "property float nx\nproperty float ny\nproperty float nz\n"
                                 "property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n"
                                 "property float f_rest_0\n"));
  EXPECT_THAT(bytes(), HasSubstr("property float f_rest_8\nproperty float opacity\nproperty float scale_0\n"
                                 "property float scale_1\nproperty float rot_0\nproperty float rot_1\n"
                                 "property float rot_2\nproperty float rot_3\nproperty float tint\nproperty "
                                 "float roughness\nend_header\n"));
}

TEST_F(Ply, HarmonicsStandChannelAfterChannel) {
  std::vector<std::string> names = degree_0;
  for (int i = 0; i < 9; ++i) names.push_back("f_rest_" + std::to_string(i));
  write(file_of(names, 1));
  const Surfels s = read_ply(file_).surfels;
  ASSERT_EQ(s.sh.dim(1), 4);
  // f_dc_c is column 3 + c; f_rest_j is column 13 + j with j = 3·channel + (coefficient − 1).
  for (int channel = 0; channel < 3; ++channel) {
    EXPECT_EQ(s.sh(0, 0, channel), static_cast<float>(3 + channel));
    for (int c = 1; c < 4; ++c) EXPECT_EQ(s.sh(0, c, channel), static_cast<float>(13 + 3 * channel + c - 1));
  }
}

TEST_F(Ply, FindsPropertiesByNameInAnyOrder) {
  std::vector<std::string> names = degree_0;
  std::reverse(names.begin(), names.end());
  names.insert(names.begin() + 4, "confidence");
  write(file_of(names, 2));
  const Surfels s = read_ply(file_).surfels;
  const auto column = [&](const std::string& name) {
    return static_cast<float>(std::find(names.begin(), names.end(), name) - names.begin());
  };
  const auto row = static_cast<float>(names.size());
  EXPECT_EQ(s.position(1, 0), row + column("x"));
  EXPECT_EQ(s.opacity_logit[1], row + column("opacity"));
  EXPECT_EQ(s.rotation(0, 0), column("rot_0"));
  EXPECT_EQ(s.log_scale(0, 1), column("scale_1"));
  EXPECT_FALSE(s.has_tint());
}

TEST_F(Ply, ReadsOtherScalarTypesAndWindowsLineEnds) {
  std::string text =
      "ply\r\nformat binary_little_endian 1.0\r\ncomment made elsewhere\r\nelement vertex 1\r\n";
  for (const std::string& name : degree_0) text += "property double " + name + "\r\n";
  text += "property uchar red\r\nelement face 0\r\nproperty list uchar int vertex_indices\r\nend_header\r\n";
  for (size_t i = 0; i < degree_0.size(); ++i) {
    const double value = 0.5 * static_cast<double>(i);
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  text += '\x01';
  write(text);
  EXPECT_EQ(read_ply(file_).surfels.position(0, 2), 1.0F);
}

TEST_F(Ply, NotesEndBeforeAllCarriageReturns) {
  std::string text = file_of(degree_0, 1);
  text.insert(text.find("element"), "comment traceflow extent 2.5 \r3\r\r\n");
  write(text);
  const PlyScene scene = read_ply(file_);
  EXPECT_EQ(scene.notes.at("extent"), "2.5 \r3");
  write_ply(file_, scene);
  EXPECT_EQ(read_ply(file_).notes, scene.notes);
}

TEST_F(Ply, GaussiansHaveAThirdScaleAndReadBackAsSurfels) {
  const PlyScene scene = {random_surfels(500, 16, true), {}, PlyVertex::gaussian};
  write_ply(file_, scene);
  EXPECT_THAT(bytes(), HasSubstr("property float scale_1\nproperty float scale_2\nproperty float rot_0\n"));
  const PlyScene back = read_ply(file_);
  EXPECT_EQ(back.vertex, PlyVertex::gaussian);
  expect_equal(back.surfels, scene.surfels);
}

// The body is 0, 1, 2, …: scale_0 = 7 is the shortest axis, so the others, 8 and 13, are the surfel's.
TEST_F(Ply, TheShortestAxisOfAGaussianIsTheNormal) {
  std::vector<std::string> names = degree_0;
  names.emplace_back("scale_2");
  write(file_of(names, 1));
  const Surfels s = read_ply(file_).surfels;
  EXPECT_EQ(s.log_scale(0, 0), 8);
  EXPECT_EQ(s.log_scale(0, 1), 13);
}

TEST_F(Ply, RefusesWhatTheHeaderDoesNotHold) {
  const std::string good = file_of(degree_0, 3);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    const size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos);
    return text.replace(at, from.size(), to);
  };
  std::vector<std::string> one_rest = degree_0;
  one_rest.emplace_back("f_rest_0");
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "first line"},
      {"plyx", "first line"},
      {"ply\n", "end_header"},
      {std::string(100000, 'a'), "first line"},
      {"ply\n" + std::string(100000, '\n'), "end_header"},
      {good.substr(0, good.size() - 1), "element vertex"},
      {with("vertex 3", "vertex 4"), "element vertex"},
      {with("vertex 3", "vertex 99999999999999999999"), "first element"},
      {with("vertex 3", "vertex 9223372036854775807"), "element vertex"},
      {with("vertex 3", "vertex -3"), "first element"},
      {with("vertex 3", "vertex"), "first element"},
      {with("vertex 3", "face 3"), "first element"},
      {with("binary_little_endian", "ascii"), "format"},
      {with("binary_little_endian", "binary_big_endian"), "format"},
      {with("format binary_little_endian 1.0\n", ""), "format"},
      {with("element vertex 3\n", ""), "header"},
      {with("property float y", "property float x"), "two of it"},
      {with("property float y", "property list uchar int y"), "property"},
      {with("property float y", "property quad y"), "property"},
      {with("property float y", "property float"), "property"},
      {with("property float y", "properties float y"), "header"},
      {with("property float y", "property float w"), "property y"},
      {"ply\nformat binary_little_endian 1.0\nelement vertex 2147483647\nend_header\n", "property x"},
      {file_of(one_rest, 3), "f_rest"},
  };
  for (const auto& [text, field] : cases) {
    write(text);
    EXPECT_THAT(refusal(), HasSubstr(field)) << text.substr(0, 200);
  }
}

TEST_F(Ply, RefusesAGapInTheHarmonicsNumbers) {
  std::vector<std::string> names = degree_0;
  for (int i = 0; i < 9; ++i) names.push_back("f_rest_" + std::to_string(i == 4 ? 40 : i));
  write(file_of(names, 1));
  EXPECT_THAT(refusal(), HasSubstr("f_rest_4"));
}

TEST_F(Ply, EveryTruncationAndEveryFlippedHeaderByteIsReadOrRefusedButNeverMore) {
  const std::string good = file_of(degree_0, 2);
  for (size_t n = 0; n < good.size(); ++n) {
    write(good.substr(0, n));
    EXPECT_NE(refusal(), "accepted") << n;
  }
  for (size_t i = 0; i < good.find("end_header"); ++i) {
    std::string text = good;
    text[i] = static_cast<char>(text[i] ^ 0x15);
    write(text);
    refusal();
  }
}

TEST_F(Ply, KeepsValuesThatAreNotFinite) {
  Surfels s = random_surfels(2, 1, false);
  s.position(1, 2) = std::numeric_limits<float>::quiet_NaN();
  s.opacity_logit[0] = std::numeric_limits<float>::infinity();
  write_ply(file_, {s, {}});
  const Surfels back = read_ply(file_).surfels;
  EXPECT_TRUE(std::isnan(back.position(1, 2)));
  EXPECT_TRUE(std::isinf(back.opacity_logit[0]));
}

TEST_F(Ply, MissingFileIsAnInputError) { EXPECT_THROW(read_ply(folder_ / "none.ply"), InputError); }

TEST(UndoNormalisation, InvertsTheMapToTheScene) {
  Surfels s = random_surfels(10, 1, false);
  const SceneNormalisation normalisation{{1.5, -2, 30}, 0.25};
  Surfels exported = s;
  undo_normalisation(normalisation, exported);
  for (int64_t i = 0; i < s.count(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const double in_scene = (exported.position(i, axis) - normalisation.centre[axis]) * normalisation.scale;
      EXPECT_NEAR(in_scene, s.position(i, axis), 1e-5);
    }
    for (int axis = 0; axis < 2; ++axis) {
      EXPECT_NEAR(std::exp(exported.log_scale(i, axis)) * normalisation.scale, std::exp(s.log_scale(i, axis)),
                  1e-5);
    }
  }
}

}  // namespace
}  // namespace traceflow
