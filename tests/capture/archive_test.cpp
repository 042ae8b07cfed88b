#include <gtest/gtest.h>

#include "capture/capture.h"
#include "fake_formats.h"
#include "files/npy.h"

namespace traceflow {
namespace {

template <class T>
void expect_same(const Tensor<T>& a, const Tensor<T>& b, const std::string& what) {
  ASSERT_EQ(a.shape(), b.shape()) << what;
  EXPECT_TRUE(std::equal(a.data(), a.data() + a.size(), b.data())) << what;
}

void expect_same_views(const Capture& one, const std::vector<View>& a, const Capture& other,
                       const std::vector<View>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].id, b[i].id);
    EXPECT_EQ(a[i].time, b[i].time) << a[i].id;
    EXPECT_EQ(a[i].camera.position, b[i].camera.position) << a[i].id;
    EXPECT_EQ(a[i].camera.camera_from_world, b[i].camera.camera_from_world) << a[i].id;
    EXPECT_EQ(a[i].camera.focal_x, b[i].camera.focal_x) << a[i].id;
    EXPECT_EQ(a[i].camera.centre_y, b[i].camera.centre_y) << a[i].id;
    const auto here = load_images(one, a[i]), there = load_images(other, b[i]);
    expect_same(here->colour, there->colour, a[i].id + ": colour");
    expect_same(here->mask, there->mask, a[i].id + ": mask");
    expect_same(here->normal_prior, there->normal_prior, a[i].id + ": normals");
  }
}

// Loads a folder and the archive of it.
void expect_archive_is_the_folder(const FakeCapture& fake, const std::string& format, size_t train,
                                  size_t test) {
  const TempFolder beside;
  const Capture folder = load_capture(fake.path(), {});
  const Capture archive = load_capture(zipped(fake.path(), beside / "capture.zip"), {});
  EXPECT_EQ(folder.format, format);
  EXPECT_EQ(folder.train.size(), train);
  EXPECT_EQ(folder.test.size(), test);
  EXPECT_EQ(archive.format, format);
  expect_same_views(folder, folder.train, archive, archive.train);
  expect_same_views(folder, folder.test, archive, archive.test);
  expect_same(folder.points, archive.points, "points");
  EXPECT_EQ(folder.normalisation.scale, archive.normalisation.scale);
  EXPECT_EQ(folder.normalisation.centre, archive.normalisation.centre);
  EXPECT_EQ(folder.near_plane, archive.near_plane);
  EXPECT_EQ(folder.far_plane, archive.far_plane);
  EXPECT_EQ(folder.has_masks, archive.has_masks);
  EXPECT_EQ(folder.has_normal_priors, archive.has_normal_priors);
  ASSERT_EQ(folder.warnings.size(), archive.warnings.size());
  for (size_t i = 0; i < folder.warnings.size(); ++i)
    EXPECT_EQ(folder.warnings[i].text, archive.warnings[i].text);
}

// With every kind of file that such a capture may have.
TEST(Archive, OfNerfDsIsReadAsItsFolder) {
  NerfDsCapture fake;
  for (int t = 0; t < 4; ++t) {
    Tensor<uint8_t> mask({8, 12});
    for (int64_t i = 0; i < mask.size(); ++i) mask[i] = (i + t) % 3 == 0 ? 255 : 0;
    fake.write_image("mask/1x/00000" + std::to_string(t) + "_left.png.png", mask);
  }
  Tensor<float> points({20, 3}), normals({4, 8, 12, 3});
  for (int64_t i = 0; i < points.size(); ++i) points[i] = 0.1F * static_cast<float>(i % 7);
  for (int64_t i = 0; i < normals.size(); ++i)
    normals[i] = i % 3 == 2 ? 1.0F : 0.1F * static_cast<float>(i % 5);
  write_npy(fake.path() / "points.npy", points);
  const TempFolder aside;
  write_npy(aside / "normal.npy", normals);
  fake.write_text("normal.npz", zip_archive({{"normal.npy", bytes_of(aside / "normal.npy")}}, true));
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_TRUE(capture.has_masks && capture.has_normal_priors);
  EXPECT_EQ(capture.points.shape(), (Shape{20, 3}));
  expect_archive_is_the_folder(fake, "nerf-ds", 4, 4);
}

TEST(Archive, OfDNerfIsReadAsItsFolder) {
  SyntheticCapture fake(true);
  fake.save();
  expect_archive_is_the_folder(fake, "d-nerf", 6, 3);
}

TEST(Archive, OfDyCheckIsReadAsItsFolder) {
  FakeCapture fake;
  fake.scene = {{"scale", 0.5}, {"center", {0.0, 0.0, 1.0}}, {"near", 0.1}, {"far", 2.0}};
  for (const int camera : {0, 1}) {
    nlohmann::json split;
    for (int t = 0; t < 3; ++t) {
      const std::string id = std::to_string(camera) + "_0000" + std::to_string(t);
      fake.add_view(id, 3 * t + camera, t, false);
      split["frame_names"].push_back(id);
      split["time_ids"].push_back(t);
      split["camera_ids"].push_back(camera);
    }
    fake.write_text(camera == 0 ? "splits/train.json" : "splits/val.json", split.dump());
  }
  fake.dataset = {{"ids", nlohmann::json::array()}};
  fake.save();
  expect_archive_is_the_folder(fake, "dycheck", 3, 3);
}

// People keep their photographs elsewhere.
TEST(Links, OfImageFoldersAndFilesAreReadAsWhatTheyLeadTo) {
  namespace fs = std::filesystem;
  NerfDsCapture nerf_ds;
  for (const auto& [id, camera] : nerf_ds.cameras)
    nerf_ds.write_image("mask/1x/" + id + ".png.png", nerf_ds.image(3));
  nerf_ds.save();
  ColmapCapture colmap;
  colmap.save();
  NgpCapture transforms;
  transforms.save();
  for (const FakeCapture* fake : {static_cast<FakeCapture*>(&nerf_ds), static_cast<FakeCapture*>(&colmap),
                                  static_cast<FakeCapture*>(&transforms)}) {
    const Capture own = load_capture(fake->path(), {});
    const TempFolder elsewhere;
    fs::create_directory(elsewhere / "linked");
    for (const fs::directory_entry& entry : fs::directory_iterator(fake->path()))
      fs::create_symlink(entry.path(), elsewhere / "linked" / entry.path().filename());
    const Capture linked = load_capture(elsewhere / "linked", {});
    EXPECT_EQ(own.format, linked.format);
    EXPECT_EQ(own.has_masks, linked.has_masks);
    expect_same_views(own, own.train, linked, linked.train);
    expect_same_views(own, own.test, linked, linked.test);
    expect_same(own.points, linked.points, "points");
    EXPECT_EQ(own.warnings.size(), linked.warnings.size());
  }
}

}  // namespace
}  // namespace traceflow
