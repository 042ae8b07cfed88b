#include "capture/formats/ply_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>

#include "base/error.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

InputFile file_of(const TempFolder& folder, const std::string& bytes) {
  std::ofstream(folder / "points.ply", std::ios::binary) << bytes;
  return InputFile(folder / "points.ply");
}

template <class T>
std::string of(T value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

const std::string text =
    "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 3\nproperty uint8 red\nproperty float x\n"
    "property float y\nproperty double z\nproperty uint8 green\nelement face 1\nproperty list uchar int "
    "vertex_index\nend_header\n";
const std::string rows = "9 1 2.5 -3e1 7\n8 4 5 6 7\n\t0 0 0 .5 7\n3 0 1 2\n";

TEST(PlyPoints, text) {
  const TempFolder folder;
  const auto points = read_ply_points(file_of(folder, text + rows));
  EXPECT_THAT(points, ElementsAre(Vec3<double>(1, 2.5, -30), Vec3<double>(4, 5, 6), Vec3<double>(0, 0, 0.5)));
}

TEST(PlyPoints, binary) {
  const TempFolder folder;
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 5000\nproperty uchar red\nproperty double "
      "x\nproperty "
      "float y\nproperty float z\nend_header\n";
  for (int i = 0; i < 5000; ++i) bytes += '\7' + of<double>(i + 0.125) + of<float>(-1.5F) + of<float>(2.25F);
  const auto points = read_ply_points(file_of(folder, bytes));
  ASSERT_EQ(points.size(), 5000U);
  for (int i = 0; i < 5000; ++i)
    EXPECT_EQ(points[static_cast<size_t>(i)], Vec3<double>(i + 0.125, -1.5, 2.25));
}

TEST(PlyPointsHostile, every_truncation_and_flip_is_read_or_refused) {
  const TempFolder folder;
  const std::string whole = text + rows;
  for (size_t length = 0; length + 15 < whole.size(); ++length) {
    EXPECT_THROW(read_ply_points(file_of(folder, whole.substr(0, length))), InputError) << length;
  }
  for (size_t at = 0; at < whole.size(); ++at) {
    std::string broken = whole;
    broken[at] = static_cast<char>(broken[at] ^ 0x15);
    try {
      read_ply_points(file_of(folder, broken));
    } catch (const InputError&) {
    }
  }
}

TEST(PlyPointsHostile, each_is_refused_by_name) {
  const auto replaced = [](const std::string& from, const std::string& to) {
    std::string changed = text + rows;
    return changed.replace(changed.find(from), from.size(), to);
  };
  const std::pair<std::string, const char*> cases[] = {
      {replaced("vertex 3", "vertex 99999999999"), "element vertex: found 99999999999 vertices in a file of"},
      {replaced("vertex 3", "vertex -3"), "element vertex: found -3"},
      {replaced("vertex 3", "vertex x"), "first element"},
      {replaced("float y", "float w"), "property y: found none"},
      {replaced("2.5", "two"), "vertex 0: found \"two\", expected a number"},
      {replaced("8 4 5 6 7", "8 4 5"), "vertex 1: found nothing"},
      {replaced("property float x", "property list uchar float x"), "property: found a list"},
      {"ply\nformat binary_big_endian 1.0\nend_header\n", "format"},
      {"not a ply", "first line"},
      {"", "first line"}};
  for (const auto& [bytes, expected] : cases) {
    const TempFolder folder;
    try {
      read_ply_points(file_of(folder, bytes));
      ADD_FAILURE() << expected;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr((folder / "points.ply").string()));
      EXPECT_THAT(error.what(), HasSubstr(expected));
    }
  }
}

// The rows are zeros that take no room on the disk.
TEST(PlyPointsHostile, more_points_than_are_read_are_refused) {
  for (const auto& [format, bytes_of_a_row] : {std::pair{"binary_little_endian", 12}, {"ascii", 6}}) {
    const TempFolder folder;
    const std::string header = std::string("ply\nformat ") + format +
                               " 1.0\nelement vertex 10000001\nproperty float x\nproperty float y\n"
                               "property float z\nend_header\n";
    std::ofstream(folder / "points.ply", std::ios::binary) << header;
    std::filesystem::resize_file(folder / "points.ply",
                                 header.size() + size_t{10000001} * static_cast<size_t>(bytes_of_a_row));
    const InputFile file(folder / "points.ply");
    try {
      read_ply_points(file);
      ADD_FAILURE() << format;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("element vertex: found 10000001, expected at most 10000000"));
    }
  }
}

}  // namespace
}  // namespace traceflow
