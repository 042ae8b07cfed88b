#include "capture/formats/colmap/colmap_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "capture/formats/colmap/colmap_rows.h"
#include "support/colmap_writer.h"
#include "support/refusal.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

namespace traceflow {
namespace {

using testing::HasSubstr;

// Two cameras, three images and four points, none in the order of its ids.
ColmapFiles example() {
  const double half = std::sqrt(0.5);
  ColmapFiles files;
  files.cameras = {{9, 4, "OPENCV", 64, 48, {50, 60, 31, 25, 0.1, -0.05, 0.01, -0.02}},
                   {2, 1, "PINHOLE", 32, 24, {25, 30, 15.5, 12.5}}};
  files.images = {{30, {half, 0, 0, half}, {1, 2, 3}, 9, "left/a b.png", {5, -1, 6}},
                  {4, {2, 0, 0, 0}, {0, 0, -1}, 2, "b.jpg", {}},
                  {7, {0, 1, 0, 0}, {4, 5, 6}, 9, "c.jpg", {-1, 5}}};
  for (uint64_t i = 0; i < 4; ++i) {
    const auto x = static_cast<double>(i);
    files.points.push_back({40 - i, {x, x + 0.25, -x}, {1, 2, static_cast<uint8_t>(i)}, 0.5 * x, 2 * i});
  }
  return files;
}

void expect_example(const ColmapModel& model) {
  ASSERT_EQ(model.cameras.size(), 2U);
  EXPECT_EQ(model.cameras[0].id, 2);
  EXPECT_EQ(model.cameras[0].model, "PINHOLE");
  EXPECT_TRUE(model.cameras[0].lens.is_pinhole());
  EXPECT_EQ(model.cameras[1].lens.tangential, Vec2<double>(0.01, -0.02));
  EXPECT_EQ(model.camera(9), &model.cameras[1]);
  EXPECT_EQ(model.camera(3), nullptr);

  ASSERT_EQ(model.images.size(), 3U);
  const ColmapImage &b = model.images[0], &c = model.images[1], &a = model.images[2];
  EXPECT_TRUE(b.id == 4 && b.camera_id == 2 && b.name == "b.jpg" && b.points_seen == 0);
  EXPECT_EQ(b.camera_from_world, Mat3<double>(1));
  EXPECT_EQ(b.position, Vec3<double>(0, 0, 1));
  EXPECT_TRUE(a.id == 30 && a.name == "left/a b.png" && a.points_seen == 2);
  // A quarter turn about z: x becomes y.
  EXPECT_LT(length(a.camera_from_world * Vec3<double>(1, 0, 0) - Vec3<double>(0, 1, 0)), 1e-12);
  EXPECT_LT(length(a.camera_from_world * a.position + Vec3<double>(1, 2, 3)), 1e-12);
  // Half a turn about x.
  EXPECT_LT(length(c.camera_from_world * Vec3<double>(1, 1, 1) - Vec3<double>(1, -1, -1)), 1e-12);
  EXPECT_LT(length(c.camera_from_world * c.position + Vec3<double>(4, 5, 6)), 1e-12);
  EXPECT_EQ(c.points_seen, 1);

  ASSERT_EQ(model.points.size(), 4U);
  for (size_t i = 0; i < 4; ++i) {
    const auto x = static_cast<double>(3 - i);
    EXPECT_EQ(model.points[i].position, Vec3<double>(x, x + 0.25, -x));
    EXPECT_EQ(model.points[i].colour, Vec3<uint8_t>(1, 2, 3 - i));
    EXPECT_EQ(model.points[i].error, 0.5 * x);
    EXPECT_EQ(model.points[i].track_length, 2 * (3 - static_cast<int64_t>(i)));
  }
}

ColmapModel read(const TempFolder& folder) {
  return read_colmap_model(*FileTree::open(folder.path()), "sparse/0");
}

std::string refusal(const TempFolder& folder) {
  return refusal_of([&] { read(folder); });
}

TEST(ColmapModel, binary_and_text_say_the_same) {
  const TempFolder binary, text;
  example().save_binary(binary / "sparse/0");
  example().save_text(text / "sparse/0");
  expect_example(read(binary));
  expect_example(read(text));
}

TEST(ColmapModel, binary_goes_before_text_and_points_may_be_missing) {
  const TempFolder folder;
  example().save_binary(folder / "sparse/0");
  ColmapFiles::write(folder / "sparse/0/cameras.txt", "not looked at");
  std::filesystem::remove(folder / "sparse/0/points3D.bin");
  const ColmapModel model = read(folder);
  EXPECT_EQ(model.cameras_file, "sparse/0/cameras.bin");
  EXPECT_EQ(model.points_file, "");
  EXPECT_TRUE(model.points.empty());
}

// Files of many times a reader's piece, so that rows and numbers lie across the seams.
TEST(ColmapModel, long_files_are_read_across_their_pieces) {
  ColmapFiles files = example();
  files.images[0].points.assign(100001, 3);
  files.images[2].points.assign(33333, -1);
  for (uint64_t i = 0; i < 20000; ++i) files.points.push_back({100 + i, {1, 2, 3}, {1, 1, 1}, 0, i % 7});
  const TempFolder binary, text;
  files.save_binary(binary / "sparse/0");
  files.save_text(text / "sparse/0");
  for (const TempFolder* folder : {&binary, &text}) {
    const ColmapModel model = read(*folder);
    EXPECT_EQ(model.images[2].points_seen, 100001);
    EXPECT_EQ(model.images[1].points_seen, 0);
    ASSERT_EQ(model.points.size(), 20004U);
    EXPECT_EQ(model.points.back().track_length, 19999 % 7);
  }
}

TEST(ColmapModel, text_as_windows_and_people_write_it) {
  const TempFolder folder;
  ColmapFiles::write(folder / "sparse/0/cameras.txt",
                     "\r\n# a comment\r\n1 PINHOLE 32 24 25 30 15.5 12.5  \r\n");
  ColmapFiles::write(
      folder / "sparse/0/images.txt",
      "1 1 0 0 0 0 0 0 1 a.png\r\n\r\n2 1 0 0 0 0 0 0 1 b.png\r\n1 2 -1\r\n3 1 0 0 0 0 0 0 1 c.png");
  ColmapFiles::write(folder / "sparse/0/points3D.txt", "");
  const ColmapModel model = read(folder);
  ASSERT_EQ(model.images.size(), 3U);
  EXPECT_EQ(model.images[2].name, "c.png");
  EXPECT_EQ(model.cameras[0].lens.centre.x, 15.5);
}

TEST(ColmapModelHostile, every_truncation_is_refused) {
  ColmapFiles files = example();
  files.points.resize(1);
  files.points[0].track = 1;
  for (const auto& [name, bytes] :
       {std::pair<const char*, std::string>{"cameras.bin", files.cameras_binary()},
        {"images.bin", files.images_binary()},
        {"points3D.bin", files.points_binary()}}) {
    const TempFolder folder;
    files.save_binary(folder / "sparse/0");
    for (size_t length = 0; length < bytes.size(); ++length) {
      ColmapFiles::write(folder / "sparse/0" / name, bytes.substr(0, length));
      EXPECT_THAT(refusal(folder), HasSubstr(name)) << length;
    }
    ColmapFiles::write(folder / "sparse/0" / name, bytes + "x");
    EXPECT_THAT(refusal(folder), HasSubstr("1 bytes after the last row")) << name;
  }
}

// Where single precision can work with it.
bool is_reachable(const Vec3<double>& v) { return length(v) < 1e16; }

// What every model that is read keeps to, whatever its files say.
void expect_sound(const ColmapModel& model, size_t most_rows) {
  EXPECT_LE(model.cameras.size() + model.images.size() + model.points.size(), most_rows);
  for (const ColmapCamera& camera : model.cameras) {
    EXPECT_GT(std::min(camera.lens.width, camera.lens.height), 0);
    EXPECT_GT(std::min(camera.lens.focal.x, camera.lens.focal.y), 0);
    EXPECT_TRUE(std::isfinite(camera.lens.focal.x + camera.lens.focal.y));
    EXPECT_TRUE(std::isfinite(camera.lens.centre.x + camera.lens.centre.y));
  }
  for (const ColmapImage& image : model.images) {
    EXPECT_NE(model.camera(image.camera_id), nullptr) << image.name;
    EXPECT_TRUE(is_reachable(image.position)) << image.name;
    EXPECT_NEAR(determinant(image.camera_from_world), 1, 1e-6) << image.name;
    EXPECT_GE(image.points_seen, 0);
    EXPECT_LE(image.points_seen, static_cast<int64_t>(most_rows));
  }
  for (const ColmapPoint& point : model.points) {
    EXPECT_TRUE(is_reachable(point.position));
    EXPECT_GE(point.track_length, 0);
  }
}

// One line that names the file, or nothing for a model that can be worked with.
void expect_refused_or_sound(const TempFolder& folder, const std::string& name, size_t bytes) {
  const std::string said = refusal_of([&] { expect_sound(read(folder), bytes); });
  if (said == "accepted") return;
  EXPECT_THAT(said, HasSubstr(name));
  EXPECT_EQ(said.find('\n'), std::string::npos) << said;
}

TEST(ColmapModelHostile, every_flipped_byte_is_refused_or_leaves_a_sound_model) {
  const ColmapFiles files = example();
  for (const auto& [name, bytes] :
       {std::pair<const char*, std::string>{"cameras.bin", files.cameras_binary()},
        {"images.bin", files.images_binary()},
        {"points3D.bin", files.points_binary()},
        {"cameras.txt", files.cameras_text()},
        {"images.txt", files.images_text()},
        {"points3D.txt", files.points_text()}}) {
    const TempFolder folder;
    const bool binary = std::string(name).ends_with(".bin");
    binary ? files.save_binary(folder / "sparse/0") : files.save_text(folder / "sparse/0");
    for (size_t at = 0; at < bytes.size(); ++at) {
      for (const int flip : {0x55, 0x80, 0xff, 0x10, 0x40}) {
        std::string broken = bytes;
        broken[at] = static_cast<char>(broken[at] ^ flip);
        ColmapFiles::write(folder / "sparse/0" / name, broken);
        SCOPED_TRACE(std::string(name) + " byte " + std::to_string(at));
        expect_refused_or_sound(folder, name, bytes.size());
      }
    }
  }
}

// A number of rows at the start that no file could hold.
TEST(ColmapModelHostile, counts_are_capped_by_the_file) {
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    const TempFolder folder;
    example().save_binary(folder / "sparse/0");
    ColmapFiles::write(folder / "sparse/0" / name, std::string(7, '\xff') + '\x7f' + std::string(100, 'x'));
    EXPECT_THAT(refusal(folder), HasSubstr("9223372036854775807 in the 100 bytes that follow"));
  }
}

TEST(ColmapModelHostile, more_points_than_are_read_are_refused) {
  const TempFolder folder;
  example().save_binary(folder / "sparse/0");
  example().save_text(folder / "sparse/0");
  {
    const InputFile binary(folder / "sparse/0/points3D.bin"), text(folder / "sparse/0/points3D.txt");
    EXPECT_EQ(read_colmap_points_binary(binary, 4).size(), 4U);
    EXPECT_EQ(read_colmap_points_text(text, 4).size(), 4U);
    EXPECT_THAT(refusal_of([&] { read_colmap_points_binary(binary, 3); }),
                HasSubstr("points3D.bin: the number of points: found 4, expected at most 3"));
    EXPECT_THAT(refusal_of([&] { read_colmap_points_text(text, 3); }),
                HasSubstr("found one point more, expected at most 3"));
  }
  // Of zeros that take no room on the disk.
  ColmapFiles::write(folder / "sparse/0/points3D.bin", little_endian(max_capture_points + 1, 8));
  std::filesystem::resize_file(folder / "sparse/0/points3D.bin", 8 + 51 * (max_capture_points + 1));
  EXPECT_THAT(refusal(folder), HasSubstr("the number of points: found 10000001, expected at most 10000000"));
}

TEST(ColmapModelHostile, each_is_refused_by_name) {
  const double nan = std::nan(""), infinity = HUGE_VAL;
  using Change = std::function<void(ColmapFiles&)>;
  const std::tuple<const char*, Change, const char*> cases[] = {
      {"cameras", [](ColmapFiles& f) { f.cameras[1].id = 9; }, "cameras[1].id: found 9 a second time"},
      {"cameras", [](ColmapFiles& f) { f.cameras[0].parameters[1] = 0; }, "cameras[0].params[1]: found 0"},
      {"cameras", [](ColmapFiles& f) { f.cameras[0].width = 0; }, "cameras[0].width: found 0"},
      {"cameras",
       [](ColmapFiles& f) {
         f.cameras[0] = {9, 13, "DIVISION", 9, 9, {1, 1, 1, 1, 1}};
       },
       "cameras[0].model: found DIVISION"},
      {"images", [](ColmapFiles& f) { f.images[1].id = 30; }, "images[1].id: found 30 a second time"},
      {"images", [](ColmapFiles& f) { f.images[2].name = "b.jpg"; },
       "images[2].name: found b.jpg a second time"},
      {"images", [](ColmapFiles& f) { f.images[2].name = ""; }, "images[2].name: found nothing"},
      {"images", [](ColmapFiles& f) { f.images[1].camera = 3; },
       "images[1].camera_id: found 3, expected a camera of"},
      {"images",
       [](ColmapFiles& f) {
         f.images[2].quaternion = {0, 0, 0, 0};
       },
       "images[2].qvec: found 0.0"},
      {"images", [=](ColmapFiles& f) { f.images[2].quaternion[1] = nan; }, "images[2].qvec: found"},
      {"images", [=](ColmapFiles& f) { f.images[0].translation[1] = infinity; }, "images[0].tvec: found 1.0"},
      {"points3D", [=](ColmapFiles& f) { f.points[3].position[2] = nan; }, "points3D[3].xyz: found 3.0"},
      {"points3D", [](ColmapFiles& f) { f.points[3].id = 40; }, "points3D[3].id: found 40 a second time"}};
  for (const auto& [file, change, expected] : cases) {
    ColmapFiles files = example();
    change(files);
    const TempFolder binary, text;
    files.save_binary(binary / "sparse/0");
    files.save_text(text / "sparse/0");
    EXPECT_THAT(refusal(binary), HasSubstr((binary / "sparse/0" / file).string() + ".bin: " + expected));
    EXPECT_THAT(refusal(text), HasSubstr((text / "sparse/0" / file).string() + ".txt: " + expected));
  }
}

TEST(ColmapModelHostile, text_is_refused_by_its_line) {
  const std::tuple<const char*, const char*, const char*> cases[] = {
      {"cameras.txt", "# c\n1 PINHOLE 32",
       "line 2, cameras[0].height: found the end of the line, expected a number"},
      {"cameras.txt", "1 PINHOLE 32 24 1 2 3 x", "line 1, cameras[0].params: found \"x\""},
      {"cameras.txt", "1 PINHOLE -32 24 1 2 3 4", "line 1, cameras[0].width: found \"-32\""},
      {"cameras.txt", "1 KODAK 32 24 1 2 3 4",
       "cameras[0].model: found \"KODAK\", expected a camera model of COLMAP"},
      {"images.txt", "1 1 0 0 0 0 0 0", "line 1, images[0].camera_id"},
      {"images.txt", "1 1 0 0 zero 0 0 0 1 a.png", "line 1, images[0].qvec: found \"zero\""},
      {"images.txt", "1 1 0 0 0 0 0 0 1 a.png\n2 1 0 0 0 0 0 0 1 b.png\n",
       "line 2, images[0].points2D: found 10 words"},
      {"points3D.txt", "1 2 3 4 5 6 256 0", "line 1, points3D[0].rgb: found \"256\""},
      {"points3D.txt", "1 2 3", "line 1, points3D[0].xyz: found the end"}};
  for (const auto& [name, content, expected] : cases) {
    const TempFolder folder;
    example().save_text(folder / "sparse/0");
    ColmapFiles::write(folder / "sparse/0" / name, content);
    EXPECT_THAT(refusal(folder), HasSubstr((folder / "sparse/0" / name).string() + ": " + expected));
  }
}

TEST(ColmapModelHostile, a_folder_without_a_model) {
  const TempFolder folder;
  EXPECT_THAT(refusal(folder), HasSubstr("expected a COLMAP model"));
  ColmapFiles::write(folder / "sparse/0/cameras.bin", example().cameras_binary());
  EXPECT_THAT(refusal(folder), HasSubstr("no cameras and images"));
}

}  // namespace
}  // namespace traceflow
