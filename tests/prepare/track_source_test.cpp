#include "prepare/track_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <functional>

#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

// The same tracks as different programs write them.
namespace traceflow::prepare {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr int64_t times = 4, points = 7;

// A .npy file, written after the format's description.
template <class T>
std::string npy_file(const std::string& type, const Shape& shape, const std::vector<T>& values) {
  std::string sides;
  for (int i = 0; i < shape.rank(); ++i) sides += std::to_string(shape[i]) + ", ";
  std::string header = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (" + sides + "), }";
  header.append(117 - header.size(), ' ').push_back('\n');
  std::string text = "\x93NUMPY\x01" + std::string(1, '\0') + little_endian(header.size(), 2) + header;
  text.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
  return text;
}

// x and y of time t and point n, in pixels of which the first has its centre at 0.
float coordinate(int64_t t, int64_t n, int64_t side) {
  return static_cast<float>(3 * t + 5 * n + 11 * side) + 0.25F;
}
bool is_visible(int64_t t, int64_t n) { return (t + 2 * n) % 3 != 0; }

struct Layout {
  std::string visibility;
  bool is_points_first = false, is_batch = false, is_from_corner = false;
};

class TrackSourceTest : public testing::Test {
 protected:
  // value(visible): how the array says so.
  template <class T>
  std::filesystem::path write(const Layout& layout, const std::string& type,
                              const std::function<T(bool)>& value) const {
    std::vector<float> at;
    std::vector<T> seen;
    for (int64_t i = 0; i < times * points; ++i) {
      const int64_t t = layout.is_points_first ? i % times : i / points,
                    n = layout.is_points_first ? i / times : i % points;
      for (int64_t side : {0, 1}) at.push_back(coordinate(t, n, side) + (layout.is_from_corner ? 0.5F : 0));
      seen.push_back(value(is_visible(t, n)));
    }
    const int64_t first = layout.is_points_first ? points : times, second = times * points / first;
    const Shape tracks = layout.is_batch ? Shape{1, first, second, 2} : Shape{first, second, 2},
                visibility = layout.is_batch ? Shape{1, first, second, 1} : Shape{first, second};
    std::filesystem::path path = folder_ / "tracks.npz";
    write_bytes(path, zip_archive({{layout.visibility + ".npy", npy_file(type, visibility, seen)},
                                   {"tracks.npy", npy_file("<f4", tracks, at)}},
                                  true));
    return path;
  }

  static void expect_all(const TrackSource& source) {
    ASSERT_EQ(source.times(), times);
    ASSERT_EQ(source.points(), points);
    const std::vector<std::string> ids{"c", "lost", "a", "b"};
    const Tensor<float> rows = source.rows(ids, {{"a", 0}, {"b", 3}, {"c", 2}}, 80, 40);
    ASSERT_EQ(rows.shape(), (Shape{4, points, 3}));
    for (int64_t row = 0; row < 4; ++row) {
      const int64_t t = std::array<int64_t, 4>{2, -1, 0, 3}[static_cast<size_t>(row)];
      for (int64_t n = 0; n < points; ++n) {
        const bool is_there = t >= 0 && is_visible(t, n);
        EXPECT_EQ(rows(row, n, 2), is_there ? 1 : 0) << row << " " << n;
        if (!is_there) continue;
        EXPECT_FLOAT_EQ(rows(row, n, 0), (coordinate(t, n, 0) + 0.5F) / 80);
        EXPECT_FLOAT_EQ(rows(row, n, 1), (coordinate(t, n, 1) + 0.5F) / 40);
      }
    }
  }

  TempFolder folder_;
  const std::function<bool(int64_t)> fits_ = [](int64_t count) { return count == times; };
};

TEST_F(TrackSourceTest, OfCoTracker) {
  for (const bool is_batch : {false, true}) {
    const TrackSource source(
        write<float>({"visibility", false, is_batch, false}, "<f4", [](bool v) { return v ? 0.9F : 0.3F; }),
        fits_);
    EXPECT_EQ(source.assumed(), "visibility: times first, pixels from the centre of the first");
    expect_all(source);
  }
}

TEST_F(TrackSourceTest, OfTapir) {
  for (const bool is_batch : {false, true}) {
    const TrackSource visibles(
        write<uint8_t>({"visibles", true, is_batch, true}, "|b1", [](bool v) { return v ? 1 : 0; }), fits_);
    EXPECT_EQ(visibles.assumed(), "visibles: points first, pixels from the corner of the first");
    expect_all(visibles);
  }
  const TrackSource occluded(
      write<uint8_t>({"occluded", true, false, true}, "|b1", [](bool v) { return v ? 0 : 1; }), fits_);
  EXPECT_THAT(occluded.assumed(), HasSubstr("occluded: points first"));
  expect_all(occluded);
  const TrackSource logits(
      write<float>({"occlusion", true, true, true}, "<f4", [](bool v) { return v ? -0.2F : 0.3F; }), fits_);
  EXPECT_THAT(logits.assumed(), HasSubstr("occlusion as logits: points first"));
  expect_all(logits);
}

// Neither the names nor the numbers alone decide the order.
TEST_F(TrackSourceTest, InTheOrderThatFitsTheViews) {
  const TrackSource turned(
      write<uint8_t>({"visibility", true, false, false}, "|b1", [](bool v) { return v ? 1 : 0; }), fits_);
  EXPECT_THAT(turned.assumed(), HasSubstr("visibility: points first"));
  expect_all(turned);
  const TrackSource turned_back(
      write<uint8_t>({"visibles", false, false, true}, "|b1", [](bool v) { return v ? 1 : 0; }), fits_);
  EXPECT_THAT(turned_back.assumed(), HasSubstr("visibles: times first"));
  expect_all(turned_back);
  // Where both fit, or none does, the name decides.
  for (const bool fit : {false, true}) {
    const TrackSource named(
        write<uint8_t>({"visibles", true, false, true}, "|b1", [](bool v) { return v ? 1 : 0; }),
        [=](int64_t) { return fit; });
    expect_all(named);
  }
}

TEST_F(TrackSourceTest, WhatDoesNotBelongTogetherIsRefused) {
  const auto refusal = [&](const std::vector<std::pair<std::string, std::string>>& members) {
    write_bytes(folder_ / "tracks.npz", zip_archive(members, false));
    return refusal_of([&] { TrackSource(folder_ / "tracks.npz", fits_); });
  };
  const auto floats = [](const Shape& shape) {
    return npy_file("<f4", shape, std::vector<float>(static_cast<size_t>(shape.elements())));
  };
  EXPECT_THAT(refusal({{"tracks.npy", floats({4, 7, 2})}, {"seen.npy", floats({4, 7})}}),
              HasSubstr("found arrays tracks, seen, expected tracks with visibility (CoTracker), visibles"));
  EXPECT_THAT(refusal({{"points.npy", floats({4, 7, 2})}, {"visibles.npy", floats({4, 7})}}),
              HasSubstr("an array named tracks"));
  EXPECT_THAT(refusal({{"tracks.npy", floats({4, 7, 2})}, {"visibility.npy", floats({7, 4})}}),
              AllOf(HasSubstr("visibility: found 7x4"), HasSubstr("4x7, as tracks has")));
  EXPECT_THAT(refusal({{"tracks.npy", floats({4, 7, 3})}, {"visibility.npy", floats({4, 7})}}),
              HasSubstr("tracks: found 4x7x3, expected T×N×2"));
  EXPECT_THAT(refusal({{"tracks.npy", floats({7, 4, 3})}, {"visibles.npy", floats({7, 4})}}),
              HasSubstr("tracks: found 7x4x3, expected N×T×2"));
}

}  // namespace
}  // namespace traceflow::prepare
