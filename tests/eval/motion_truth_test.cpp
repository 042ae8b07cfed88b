#include "capture/motion_truth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "capture/synth/synth.h"
#include "files/npy.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

namespace traceflow {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class MotionTruthFiles : public ::testing::Test {
 protected:
  MotionTruthFiles() {
    SynthOptions synth;
    synth.frames = 2;
    synth.width = 16;
    synth.height = 12;
    synth.samples = 1;
    synth.points = 50;
    write_synthetic_capture(synth, capture());
    fs::create_directories(capture() / "truth/motion");
    fs::remove(points());
    fs::remove(objects());
  }
  fs::path capture() const { return folder_ / "capture"; }
  fs::path points() const { return capture() / "truth/motion/points.npy"; }
  fs::path objects() const { return capture() / "truth/motion/object.npy"; }

  // An array of numbers of a type as numpy writes it.
  template <class T>
  static void write_array(const fs::path& path, const std::string& type, const std::string& shape,
                          const std::vector<T>& values) {
    const std::string header = "{'descr': '" + type + "', 'fortran_order': False, 'shape': " + shape + "}\n";
    std::string text = "\x93NUMPY" + std::string{'\1', '\0', static_cast<char>(header.size()), '\0'} + header;
    text.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    std::ofstream(path, std::ios::binary) << text;
  }
  void write_good_files() const {
    std::vector<float> values(2 * 3 * 3);
    for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i) / 4;
    write_array(points(), "<f4", "(2, 3, 3)", values);
    write_array<uint8_t>(objects(), "|u1", "(3,)", {2, 2, 9});
  }
  std::string refusal() const {
    return refusal_of([&] { load_motion_truth(load_capture(capture(), {})); });
  }

  TempFolder folder_;
};

TEST_F(MotionTruthFiles, AreReadInAnyTypeFromAFolderAndFromAnArchive) {
  EXPECT_FALSE(load_motion_truth(load_capture(capture(), {}))) << "none is no error";
  write_good_files();
  std::vector<std::pair<std::string, std::string>> members;
  for (const auto& entry : fs::recursive_directory_iterator(capture())) {
    if (entry.is_regular_file())
      members.emplace_back(fs::relative(entry.path(), capture()).string(), bytes_of(entry.path()));
  }
  std::ofstream(folder_ / "capture.zip", std::ios::binary) << zip_archive(members, true);
  for (const fs::path& path : {capture(), folder_ / "capture.zip"}) {
    const auto truth = load_motion_truth(load_capture(path, {}));
    ASSERT_TRUE(truth);
    EXPECT_EQ(truth->times(), 2);
    EXPECT_EQ(truth->count(), 3);
    EXPECT_EQ(truth->points(1, 2, 0), 15.0F / 4);
    EXPECT_EQ(truth->object[2], 9);
  }
  write_array(points(), "<f8", "(2, 1, 3)", std::vector<double>{1, 2, 3, 4, 5, 6.5});
  write_array<int64_t>(objects(), "<i8", "(1,)", {-3});
  const auto wide = load_motion_truth(load_capture(capture(), {}));
  EXPECT_EQ(wide->points(1, 0, 2), 6.5F);
  EXPECT_EQ(wide->object[0], -3);
  write_array<uint16_t>(points(), "<f2", "(2, 1, 3)", {0x3c00, 0, 0, 0x4000, 0, 0x3800});
  const auto half = load_motion_truth(load_capture(capture(), {}));
  EXPECT_EQ(half->points(1, 0, 0), 2);
  EXPECT_EQ(half->points(1, 0, 2), 0.5F);
}

TEST_F(MotionTruthFiles, OneWithoutTheOtherIsRefused) {
  write_good_files();
  fs::remove(objects());
  EXPECT_THAT(refusal(), AllOf(HasSubstr("truth/motion/object.npy: found no such file"),
                               HasSubstr("points.npy and object.npy, both or neither")));
  write_good_files();
  fs::remove(points());
  EXPECT_THAT(refusal(), HasSubstr("truth/motion/points.npy: found no such file"));
}

TEST_F(MotionTruthFiles, OfAnotherShapeAreRefused) {
  write_good_files();
  for (const auto& [shape, size] : std::vector<std::pair<std::string, size_t>>{
           {"(2, 9)", 18}, {"(3, 3, 2)", 18}, {"(1, 3, 3)", 9}, {"(2, 0, 3)", 0}, {"(2, 3, 3, 1)", 18}}) {
    write_array(points(), "<f4", shape, std::vector<float>(size));
    EXPECT_THAT(refusal(), AllOf(HasSubstr("truth/motion/points.npy: shape: found "), HasSubstr("T×N×3")))
        << shape;
  }
  write_good_files();
  for (const auto& [shape, size] :
       std::vector<std::pair<std::string, size_t>>{{"(4,)", 4}, {"(3, 1)", 3}, {"(0,)", 0}}) {
    write_array(objects(), "|u1", shape, std::vector<uint8_t>(size));
    EXPECT_THAT(refusal(), AllOf(HasSubstr("truth/motion/object.npy: shape: found "),
                                 HasSubstr("one number for each of the 3 points")))
        << shape;
  }
}

TEST_F(MotionTruthFiles, OfOtherNumbersAreRefused) {
  write_good_files();
  std::vector<float> values(18);
  values[13] = std::numeric_limits<float>::quiet_NaN();
  write_array(points(), "<f4", "(2, 3, 3)", values);
  EXPECT_THAT(refusal(), HasSubstr("points.npy: time 1, point 1: found nan, expected finite coordinates"));
  write_good_files();
  for (const float id : {0.5F, 3e8F, std::numeric_limits<float>::infinity()}) {
    write_array<float>(objects(), "<f4", "(3,)", {1, id, 1});
    EXPECT_THAT(refusal(), AllOf(HasSubstr("object.npy: point 1: found "), HasSubstr("whole number")));
  }
  write_array<float>(objects(), "<f4", "(3,)", {1});
  EXPECT_THAT(refusal(), HasSubstr("object.npy: shape: found 3"));
  std::ofstream(points()) << "no array";
  EXPECT_THAT(refusal(), HasSubstr("points.npy"));
}

}  // namespace
}  // namespace traceflow
