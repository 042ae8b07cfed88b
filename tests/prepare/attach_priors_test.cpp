#include "prepare/attach_priors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <glm/gtc/quaternion.hpp>
#include <numeric>

#include "base/error.h"
#include "base/folder_lock.h"
#include "base/process.h"
#include "capture/image_cache.h"
#include "files/jpeg.h"
#include "files/npy.h"
#include "files/png.h"
#include "prepare/capture_folder.h"
#include "prepare/masks.h"
#include "prepare/normal_source.h"
#include "prepare/picture_source.h"
#include "small_capture.h"
#include "support/colmap_writer.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

namespace traceflow::prepare {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

SynthOptions small() {
  SynthOptions options = small_capture();
  options.prior_noise = 0;
  return options;
}

// A synthetic capture, its priors taken away and given as another program would have left them.
class AttachPriors : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    made = std::make_unique<TempFolder>();
    write_synthetic_capture(small(), *made / "capture");
  }
  static void TearDownTestSuite() { made.reset(); }

  AttachPriors() {
    fs::copy(*made / "capture", capture(), fs::copy_options::recursive);
    fs::remove_all(capture() / "normal");
    truth_ = load_capture(*made / "capture", {});
  }

  fs::path capture() const { return folder_ / "capture"; }

  // The training views' normals on other axes than OpenGL's: element i of the array belongs to view i.
  Tensor<float> normals_in(const Vec3<double>& signs) const {
    Tensor<float> array({static_cast<int64_t>(truth_.train.size()), 48, 80, 3});
    for (size_t i = 0; i < truth_.train.size(); ++i) {
      const View& view = truth_.train[i];
      const auto images = load_images(truth_, view);
      for (int64_t k = 0; k < 48 * 80; ++k) {
        const Vec3<float> in_camera =
            view.camera.camera_from_world * load3<float>(&images->normal_prior[3 * k]);
        store3(array.row(static_cast<int64_t>(i)) + 3 * k, Vec3<float>(signs) * in_camera);
      }
    }
    return array;
  }

  // "0.png" … of 8 bits, colours meaning 2v − 1.
  static void write_normal_pictures(const Tensor<float>& normals, const fs::path& folder,
                                    const std::string& ending) {
    fs::create_directory(folder);
    for (int64_t i = 0; i < normals.dim(0); ++i) {
      Tensor<uint8_t> picture({normals.dim(1), normals.dim(2), 3});
      for (int64_t k = 0; k < picture.size(); ++k)
        picture[k] = static_cast<uint8_t>(std::lround(127.5F * (normals.row(i)[k] + 1)));
      const fs::path file = folder / (std::to_string(i) + ending);
      write_png(file, picture);
      if (ending == ".jpg") write_bytes(file, jpeg_bytes(picture, 95));
    }
  }

  std::string attach(const AttachOptions& options) { return attach(options, capture()); }
  std::string attach(const AttachOptions& options, const fs::path& capture) {
    std::string said;
    attach_priors(
        capture, options, [&](const std::string& line) { said += line + "\n"; }, never_);
    return said;
  }

  // In degrees, of all pixels of the training views in the order of size.
  std::vector<double> angles_to_the_truth() const {
    std::vector<double> angles;
    const Capture attached = load_capture(capture(), {});
    for (const View& view : attached.train) {
      const auto found = load_images(attached, view), truth = load_images(truth_, view);
      for (int64_t k = 0; k < truth->normal_prior.size(); k += 3) {
        const double cosine =
            dot(load3<float>(&found->normal_prior[k]), load3<float>(&truth->normal_prior[k]));
        angles.push_back(glm::degrees(std::acos(std::clamp(cosine, -1.0, 1.0))));
      }
    }
    std::sort(angles.begin(), angles.end());
    return angles;
  }

  // A COLMAP project of what the left camera saw.
  fs::path write_colmap_project() const {
    fs::path project = folder_ / "project";
    fs::create_directories(project / "images");
    ColmapFiles files;
    for (const SynthView& view : synth_views(small())) {
      if (view.is_test) continue;
      const Camera<double>& c = view.camera;
      if (files.cameras.empty())
        files.cameras.push_back({1, 1, "PINHOLE", 80, 48, {c.focal_x, c.focal_y, c.centre_x, c.centre_y}});
      const glm::dquat q = glm::quat_cast(c.camera_from_world);
      const Vec3<double> t = -(c.camera_from_world * c.position);
      const auto id = static_cast<uint32_t>(files.images.size() + 1);
      files.images.push_back({id, {q.w, q.x, q.y, q.z}, {t.x, t.y, t.z}, 1, view.id + ".png", {}});
      fs::copy(*made / "capture/rgb/1x" / (view.id + ".png"), project / "images");
    }
    const Tensor<float> points = synth_points(small());
    for (int64_t i = 0; i < points.dim(0); ++i) {
      const Vec3<double> x(load3<float>(points.row(i)));
      files.points.push_back({static_cast<uint64_t>(i + 1), {x.x, x.y, x.z}, {9, 9, 9}, 0.5, 3});
    }
    files.save_binary(project / "sparse/0");
    return project;
  }

  void expect_normals_of_the_truth(double tolerance) const {
    expect_normals_of_the_truth(tolerance, capture());
  }
  void expect_normals_of_the_truth(double tolerance, const fs::path& capture) const {
    const Capture attached = load_capture(capture, {});
    EXPECT_EQ(attached.prior_axes, PriorAxes::opengl);
    for (const View& view : attached.train) {
      const auto found = load_images(attached, view), truth = load_images(truth_, view);
      ASSERT_FALSE(found->normal_prior.empty());
      double worst = 0;
      for (int64_t k = 0; k < found->normal_prior.size(); k += 3) {
        const Vec3<float> a = load3<float>(&found->normal_prior[k]),
                          b = load3<float>(&truth->normal_prior[k]);
        worst = std::max(worst, static_cast<double>(length(a - b)));
      }
      EXPECT_LT(worst, tolerance) << view.id;
    }
  }

  std::string refusal(const AttachOptions& options) {
    try {
      attach(options);
    } catch (const InputError& error) {
      EXPECT_FALSE(fs::exists(capture() / ".attach-priors"));
      return error.what();
    }
    return "";
  }

  static std::unique_ptr<TempFolder> made;
  TempFolder folder_;
  Capture truth_;
  const std::atomic<bool> never_ = false;
};
std::unique_ptr<TempFolder> AttachPriors::made;

TEST_F(AttachPriors, FindsTheAxesOfEachKind) {
  const std::vector<std::pair<Vec3<double>, std::string>> kinds = {{{1, -1, -1}, "opengl"},
                                                                   {{1, 1, 1}, "opencv"},
                                                                   {{-1, -1, -1}, "stable-normal"},
                                                                   {{-1, 1, -1}, "taken as measured"}};
  for (const auto& [signs, name] : kinds) {
    write_npy(folder_ / "normals.npy", normals_in(signs));
    AttachOptions options;
    options.normals = folder_ / "normals.npy";
    options.force = true;
    const std::string said = attach(options);
    EXPECT_THAT(said, HasSubstr(name));
    EXPECT_THAT(said, HasSubstr("correlation with the geometry x "));
    expect_normals_of_the_truth(0.012);  // the truth itself has 8 bits
  }
}

// Points of the scene, as a program would track them through the training views: in pixels of pictures of
// some width, the centre of the first pixel at 0. Point 3 is lost in view 1.
std::string tracks_archive(const Capture& capture, int64_t points, double width, bool is_batch = false) {
  const auto views = static_cast<int64_t>(capture.train.size());
  Tensor<float> tracks(is_batch ? Shape{1, views, points, 2} : Shape{views, points, 2});
  Tensor<float> visibility({views, points});
  visibility.fill(1);
  visibility(1, 3) = 0;
  for (int64_t v = 0; v < views; ++v) {
    const Camera<float>& camera = capture.train[static_cast<size_t>(v)].camera;
    for (int64_t n = 0; n < points; ++n) {
      const Vec2<float> at = camera.project(camera.point_in_camera(load3<float>(capture.points.row(n))));
      for (int side = 0; side < 2; ++side)
        tracks[2 * (v * points + n) + side] = static_cast<float>(at[side] * width / camera.width - 0.5);
    }
  }
  const TempFolder folder;
  write_npy(folder / "tracks.npy", tracks);
  write_npy(folder / "visibility.npy", visibility);
  return zip_archive({{"tracks.npy", bytes_of(folder / "tracks.npy")},
                      {"visibility.npy", bytes_of(folder / "visibility.npy")}},
                     true);
}

TEST_F(AttachPriors, TracksComeBackAsDirections) {
  constexpr int64_t points = 40;
  for (const double width : {80.0, 320.0}) {
    write_bytes(folder_ / "tracks.npz", tracks_archive(truth_, points, width, width > 80));
    AttachOptions options;
    options.tracks = folder_ / "tracks.npz";
    options.tracks_width = width > 80 ? static_cast<int>(width) : 0;
    options.force = true;
    EXPECT_THAT(attach(options), HasSubstr("40 points on 5 training views"));
    // At any size.
    for (const int downscale : {1, 2}) {
      CaptureOptions size;
      size.downscale = downscale;
      const Capture attached = load_capture(capture(), size);
      ASSERT_EQ(attached.tracks.count(), points);
      int64_t seen = 0;
      for (int64_t v = 0; v < 5; ++v) {
        const Camera<float>& camera = attached.train[static_cast<size_t>(v)].camera;
        for (int64_t n = 0; n < points; ++n) {
          const Vec3<float> x = camera.point_in_camera(load3<float>(truth_.points.row(n)));
          const bool is_inside = camera.sees(load3<float>(truth_.points.row(n)));
          EXPECT_EQ(attached.tracks.seen(v, n) == 1, is_inside && (v != 1 || n != 3)) << v << " " << n;
          if (attached.tracks.seen(v, n) == 0) continue;
          ++seen;
          EXPECT_NEAR(attached.tracks.direction(v, n, 0), x.x / x.z, 1e-5);
          EXPECT_NEAR(attached.tracks.direction(v, n, 1), x.y / x.z, 1e-5);
        }
      }
      EXPECT_GT(seen, 100);
    }
  }
}

TEST_F(AttachPriors, RefusesTracksOfOtherPictures) {
  AttachOptions options;
  options.tracks = folder_ / "tracks.npz";
  write_bytes(options.tracks, tracks_archive(truth_, 40, 8000));
  EXPECT_THAT(refusal(options), HasSubstr("--tracks-width"));
  Capture shorter = truth_;
  shorter.train.pop_back();
  write_bytes(options.tracks, tracks_archive(shorter, 40, 80));
  EXPECT_THAT(refusal(options), AllOf(HasSubstr("count: found 4"), HasSubstr("5 training views")));
  EXPECT_FALSE(fs::exists(capture() / "tracks.npy"));
}

TEST_F(AttachPriors, TakesAxesThatAreNamed) {
  write_npy(folder_ / "normals.npy", normals_in({-1, -1, -1}));
  AttachOptions options;
  options.normals = folder_ / "normals.npy";
  options.axes = PriorAxes::stable_normal;
  EXPECT_THAT(attach(options), testing::Not(HasSubstr("warning")));
  expect_normals_of_the_truth(0.012);
  options.axes = PriorAxes::opencv;
  options.force = true;
  EXPECT_THAT(attach(options), HasSubstr("warning: normal priors: the axes opencv disagree"));
}

TEST_F(AttachPriors, PicturesOfAFolderGoByName) {
  const Tensor<float> normals = normals_in({-1, -1, -1});
  fs::create_directory(folder_ / "pngs");
  for (size_t i = 0; i < truth_.train.size(); ++i) {
    Tensor<float> one({48, 80, 3});
    std::copy_n(normals.row(static_cast<int64_t>(i)), one.size(), one.data());
    write_png(folder_ / "pngs" / (truth_.train[i].id + ".png"), normal_picture(one));
  }
  std::ofstream(folder_ / "pngs/0_not_one.png") << "x";  // a name more: by order it would not fit
  AttachOptions options;
  options.normals = folder_ / "pngs";
  EXPECT_THAT(attach(options), HasSubstr("5 of 7 views"));
  expect_normals_of_the_truth(0.012);
}

// As NormalCrafter leaves them.
TEST_F(AttachPriors, AnArrayInAnArchiveIsAsGood) {
  write_npy(folder_ / "normals.npy", normals_in({1, -1, -1}));
  write_bytes(folder_ / "film.npz",
              zip_archive({{"normals.npy", bytes_of(folder_ / "normals.npy")}}, true, true));
  AttachOptions options;
  options.normals = folder_ / "film.npz";
  EXPECT_THAT(attach(options), HasSubstr(": opengl"));
  expect_normals_of_the_truth(0.012);
}

TEST_F(AttachPriors, PicturesOfEightBitsAndJpegsAreTakenByOrder) {
  for (const char* ending : {".png", ".jpg"}) {
    const fs::path given = folder_ / (ending + 1);
    write_normal_pictures(normals_in({1, 1, 1}), given, ending);
    AttachOptions options;
    options.normals = given;
    options.force = true;
    EXPECT_THAT(attach(options), HasSubstr(": opencv"));
    expect_normals_of_the_truth(std::string(ending) == ".jpg" ? 0.35 : 0.02);
  }
}

TEST_F(AttachPriors, AFilmOfPicturesIsTakenByOrder) {
  if (!is_in_path("ffmpeg")) GTEST_SKIP() << "films need ffmpeg";
  write_normal_pictures(normals_in({-1, -1, -1}), folder_ / "pictures", ".png");
  const Descriptor log = open_log(folder_ / "make.log");
  ASSERT_TRUE(Process({"ffmpeg", "-nostdin", "-i", folder_ / "pictures/%d.png", "-c:v", "ffv1", "-pix_fmt",
                       "bgr0", folder_ / "x_vis.mkv"},
                      {.error = log.number()})
                  .wait());
  AttachOptions options;
  options.normals = folder_ / "x_vis.mkv";
  EXPECT_THAT(attach(options), HasSubstr(": stable-normal"));
  expect_normals_of_the_truth(0.02);
}

// What NormalCrafter's writer of films asks ffmpeg for. It keeps one colour for each four pixels: at the
// edges, which are many in so small a picture, normals are those of neither side.
TEST_F(AttachPriors, AFilmAsNormalCrafterWritesItIsNearEnough) {
  if (!is_in_path("ffmpeg")) GTEST_SKIP() << "films need ffmpeg";
  write_normal_pictures(normals_in({1, -1, -1}), folder_ / "pictures", ".png");
  const Descriptor log = open_log(folder_ / "make.log");
  const bool is_made =
      Process({"ffmpeg", "-nostdin", "-framerate", "8", "-i", folder_ / "pictures/%d.png", "-c:v", "libx264",
               "-pix_fmt", "yuv420p", "-crf", "18", folder_ / "x_vis.mp4"},
              {.error = log.number()})
          .wait();
  const std::string said = bytes_of(folder_ / "make.log");
  if (said.find("Unknown encoder") != std::string::npos) GTEST_SKIP() << "this ffmpeg has no libx264";
  ASSERT_TRUE(is_made) << said;
  AttachOptions options;
  options.normals = folder_ / "x_vis.mp4";
  EXPECT_THAT(attach(options), HasSubstr(": opengl"));
  const std::vector<double> angles = angles_to_the_truth();
  EXPECT_LT(angles[angles.size() / 2], 4);
  EXPECT_LT(angles[angles.size() * 9 / 10], 30);
}

TEST_F(AttachPriors, ACaptureOfColmapTakesThemToo) {
  const fs::path project = write_colmap_project();
  write_npy(folder_ / "normals.npy", normals_in({-1, -1, -1}));
  AttachOptions options;
  options.normals = folder_ / "normals.npy";
  options.masks = *made / "capture/mask/1x";
  // One for each view by the order of the file names, of which the first tests.
  EXPECT_THAT(attach(options, project),
              AllOf(HasSubstr("normals   5 of 5 views"), HasSubstr(": stable-normal"),
                    HasSubstr("masks     5 of 5 views")));
  const Capture attached = load_capture(project, {});
  EXPECT_EQ(attached.format, "colmap");
  EXPECT_EQ(attached.train.size(), 4U);
  EXPECT_TRUE(attached.has_masks);
  expect_normals_of_the_truth(0.012, project);
}

TEST_F(AttachPriors, ACaptureOfSmallerPhotographsAloneTakesThemToo) {
  fs::rename(capture() / "rgb/1x", capture() / "rgb/2x");
  write_npy(folder_ / "normals.npy", normals_in({-1, -1, -1}));
  AttachOptions options;
  options.normals = folder_ / "normals.npy";
  attach(options);
  CaptureOptions half;
  half.downscale = 2;
  EXPECT_TRUE(load_capture(capture(), half).has_normal_priors);
}

TEST_F(AttachPriors, WhatIsNoFolderIsRefused) {
  AttachOptions options;
  options.normals = folder_ / "normals.npy";
  write_bytes(folder_ / "capture.zip", "PK");
  EXPECT_THAT(refusal_of([&] { attach(options, folder_ / "capture.zip"); }),
              HasSubstr("capture.zip: found a file, expected a capture's folder; unpack it first"));
  EXPECT_THAT(refusal_of([&] { attach(options, folder_ / "nowhere"); }), HasSubstr("nowhere: found nothing"));
  fs::create_directory(folder_ / "empty");
  EXPECT_THAT(refusal_of([&] { attach(options, folder_ / "empty"); }), HasSubstr("empty: found no capture"));
  EXPECT_TRUE(fs::is_empty(folder_ / "empty"));
}

TEST_F(AttachPriors, MasksThatWereTurnedAreRefused) {
  const fs::path given = folder_ / "given";
  fs::create_directory(given);
  for (const View& view : truth_.train) write_mask(given / (view.id + ".png"), Tensor<uint8_t>({80, 48}));
  AttachOptions options;
  options.masks = given;
  options.force = true;
  EXPECT_THAT(refusal(options),
              HasSubstr("masks: found 48×80 for 000000_left, expected the proportions of 80×48"));
  EXPECT_TRUE(load_capture(capture(), {}).has_masks);
}

TEST_F(AttachPriors, ASecondOneIsRefusedWhileTheFirstWorks) {
  AttachOptions options;
  options.masks = *made / "capture/mask/1x";
  options.force = true;
  const FolderLock first(capture() / ".attach-priors.lock", capture(), "attaching priors");
  EXPECT_THAT(refusal(options), HasSubstr("attaching priors in it"));
}

TEST_F(AttachPriors, NormalsGoOutAgainWhereTheMasksCannotComeIn) {
  write_npy(folder_ / "normals.npy", normals_in({1, 1, 1}));
  AttachOptions options;
  options.normals = folder_ / "normals.npy";
  attach(options);
  const std::string before = bytes_of(capture() / "normal/1x" / (truth_.train.front().id + ".png"));
  write_npy(folder_ / "normals.npy", normals_in({1, -1, -1}));
  options.masks = *made / "capture/mask/1x";
  options.force = true;
  options.axes = PriorAxes::opencv;  // which gives other pictures
  // Where the old masks would go there is something already.
  const auto block = [&](const std::string& line) {
    if (line.starts_with("masks")) fs::create_directories(capture() / ".attach-priors/old mask/in the way");
  };
  EXPECT_THROW(attach_priors(capture(), options, block, never_), fs::filesystem_error);
  EXPECT_EQ(bytes_of(capture() / "normal/1x" / (truth_.train.front().id + ".png")), before);
  EXPECT_TRUE(load_capture(capture(), {}).has_masks);
}

TEST_F(AttachPriors, NothingIsReplacedUnasked) {
  write_npy(folder_ / "normals.npy", normals_in({1, 1, 1}));
  AttachOptions options;
  options.normals = folder_ / "normals.npy";
  attach(options);
  EXPECT_THAT(refusal(options), HasSubstr("add --force to replace it"));
  options = {};
  options.masks = *made / "capture/mask/1x";
  EXPECT_THAT(refusal(options), HasSubstr("mask: found something there already"));
  expect_normals_of_the_truth(0.012);
}

// resized_mask would go on serving the views that the new masks lack.
TEST_F(AttachPriors, ForceReplacesAllThatAReaderWouldTake) {
  fs::rename(capture() / "mask", capture() / "resized_mask");
  const fs::path given = folder_ / "given";
  fs::create_directory(given);
  for (const View& view : truth_.train)
    fs::copy(*made / "capture/mask/1x" / (view.id + ".png.png"), given / (view.id + ".png"));
  AttachOptions options;
  options.masks = given;
  EXPECT_THAT(refusal(options), HasSubstr("resized_mask: found something there already"));
  options.force = true;
  attach(options);
  std::ofstream(capture() / "prepare.json") << "{}";
  for (const char* name : {"truth", "synth.json"}) fs::remove_all(capture() / name);
  EXPECT_THAT([&] { check_place(capture()); },
              testing::ThrowsMessage<InputError>(HasSubstr("masks that attach-priors put there")));
  EXPECT_FALSE(fs::exists(capture() / "resized_mask"));
  EXPECT_FALSE(fs::exists(capture() / ".attach-priors"));
  const Capture attached = load_capture(capture(), {});
  for (const View& view : attached.test) EXPECT_FALSE(attached.images->source(view.id).mask);
  for (const View& view : attached.train) EXPECT_FALSE(attached.images->source(view.id).mask_is_inverted);
}

TEST_F(AttachPriors, WhatAKilledOnePutAsideComesBack) {
  const fs::path staging = capture() / ".attach-priors";
  fs::create_directories(staging / "mask/1x");
  fs::rename(capture() / "mask", staging / "old mask");
  write_npy(folder_ / "normals.npy", normals_in({1, 1, 1}));
  AttachOptions options;
  options.normals = folder_ / "normals.npy";
  attach(options);
  EXPECT_FALSE(fs::exists(staging));
  EXPECT_TRUE(load_capture(capture(), {}).has_masks);
}

TEST_F(AttachPriors, WithoutFfmpegSaysHowToGetIt) {
  AttachOptions options;
  options.masks = *made / "capture/mask/1x";
  options.force = true;
  // NOLINTBEGIN(concurrency-mt-unsafe): no other thread asks for it meanwhile
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", "/nowhere", 1);
  EXPECT_THAT(refusal(options), HasSubstr("install it with `scripts/setup --prepare`"));
  ::setenv("PATH", path.c_str(), 1);
  // NOLINTEND(concurrency-mt-unsafe)
}

TEST_F(AttachPriors, WhatDoesNotFitIsRefusedAndTheCaptureLeftAsItWas) {
  AttachOptions options;
  EXPECT_THAT(refusal(options), HasSubstr("--normals, --masks, --tracks or --depth"));
  options.normals = folder_ / "nowhere.npz";
  EXPECT_THAT(refusal(options), HasSubstr("nowhere.npz"));
  Tensor<float> short_array({3, 48, 80, 3});
  write_npy(folder_ / "short.npy", short_array);
  options.normals = folder_ / "short.npy";
  EXPECT_THAT(refusal(options), HasSubstr("short.npy: count: found 3"));
  write_npy(folder_ / "flat.npy", Tensor<float>({5, 48, 80}));
  options.normals = folder_ / "flat.npy";
  EXPECT_THAT(refusal(options), HasSubstr("expected T×H×W×3"));
  fs::create_directory(folder_ / "empty");
  options.normals = folder_ / "empty";
  EXPECT_THAT(refusal(options), HasSubstr("no pictures"));
  EXPECT_FALSE(fs::exists(capture() / "normal"));
}

TEST(FindAxes, AMixtureThatIsNotClearIsRefused) {
  const AxisEvidence mirrored{{0.9, 0.8, -0.7}, 1000}, unclear{{0.1, 0.8, -0.7}, 1000};
  EXPECT_EQ(find_axes(PriorAxes::automatic, mirrored, "n").signs, Vec3<double>(1, 1, -1));
  EXPECT_THROW(find_axes(PriorAxes::automatic, unclear, "n"), InputError);
  EXPECT_EQ(find_axes(PriorAxes::automatic, {{0.9, 0.05, -0.9}, 1000}, "n").signs, Vec3<double>(1, -1, -1));
}

// As where a capture has no points: z alone is known, and opengl and stable-normal differ in x.
TEST(FindAxes, EvidenceThatFitsTwoKindsAsksWhichItIs) {
  const AxisEvidence only_z{{0.1, 0.05, -0.9}, 1000};
  EXPECT_THAT(refusal_of([&] { find_axes(PriorAxes::automatic, only_z, "n"); }), HasSubstr("--axes"));
  EXPECT_THROW(find_axes(PriorAxes::automatic, {}, "n"), InputError);
  EXPECT_EQ(find_axes(PriorAxes::stable_normal, only_z, "n").signs, Vec3<double>(-1, -1, -1));
}

TEST(MatchViews, ByNameElseByOrder) {
  using Map = std::map<std::string, int64_t>;
  const ViewIds ids{{"a", "c"}, {"a", "b", "c"}, {"a", "lost", "another", "c"}, {"a", "x", "b", "y", "c"}};
  EXPECT_EQ(match_views("n", {"b.png", "c.png", "a.png"}, 3, ids), (Map{{"a", 2}, {"b", 0}, {"c", 1}}));
  EXPECT_EQ(match_views("n", {}, 2, ids), (Map{{"a", 0}, {"c", 1}}));
  EXPECT_EQ(match_views("n", {"x", "y", "z"}, 3, ids), (Map{{"a", 0}, {"b", 1}, {"c", 2}}));
  EXPECT_THROW(match_views("n", {"a"}, 1, ids), InputError);
  // As the loader takes an array: its elements belong to what is listed, photographs or not.
  EXPECT_EQ(match_views("n", {}, 4, ids), (Map{{"a", 0}, {"c", 3}}));
  EXPECT_EQ(match_views("n", {}, 5, ids), (Map{{"a", 0}, {"b", 2}, {"c", 4}}));
}

TEST(StemOf, LeavesTheEndingsOfPicturesOutHoweverTheyAreWritten) {
  for (const char* name : {"b/a.png", "a.JPG", "a.png.png", "a.JPG.png", "a.jpeg.png", "a.PNG.PNG"})
    EXPECT_EQ(stem_of(name), "a") << name;
  EXPECT_EQ(stem_of("view_1.5.png"), "view_1.5");
}

TEST(NormalPicture, HasSixteenBitsAndBlackForNone) {
  Tensor<float> normals({1, 2, 3});
  store3(normals.data(), Vec3<float>(0, 0, -3));
  const Tensor<uint16_t> picture = normal_picture(normals);
  EXPECT_EQ(picture[0], 32768);
  EXPECT_EQ(picture[2], 0);
  EXPECT_EQ(picture[3], 0);
  const TempFolder folder;
  write_png(folder / "n.png", picture);
  const Tensor<uint16_t> back = read_png16(InputFile(folder / "n.png"));
  ASSERT_EQ(back.shape(), picture.shape());
  for (int64_t i = 0; i < back.size(); ++i) EXPECT_EQ(back[i], picture[i]);
}

}  // namespace
}  // namespace traceflow::prepare
