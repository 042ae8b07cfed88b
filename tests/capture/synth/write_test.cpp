#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "capture/capture.h"
#include "capture/synth/synth.h"
#include "files/npy.h"
#include "files/png.h"
#include "support/file_bytes.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

SynthOptions tiny_options() {
  SynthOptions options;
  options.frames = 6;
  options.width = 32;
  options.height = 18;
  options.samples = 2;
  options.points = 50;
  return options;
}

Json json_of(const fs::path& path) { return Json::parse(bytes_of(path)); }

std::vector<std::string> files_below(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) names.push_back(fs::relative(entry.path(), folder).string());
  }
  std::ranges::sort(names);
  return names;
}

TEST(SynthWrite, LayoutIsComplete) {
  const TempFolder temp;
  const fs::path out = temp / "capture";
  write_synthetic_capture(tiny_options(), out);

  const Json dataset = json_of(out / "dataset.json");
  EXPECT_EQ(dataset["count"], 7);
  EXPECT_EQ(dataset["train_ids"].size(), 6);
  EXPECT_EQ(dataset["val_ids"], Json::array({"000002_right"}));
  const Json metadata = json_of(out / "metadata.json");
  for (const Json& id : dataset["ids"]) {
    const auto name = id.get<std::string>();
    EXPECT_EQ(metadata[name]["time_id"], std::stoi(name));
    EXPECT_EQ(read_png(out / "rgb/1x" / (name + ".png")).shape(), Shape({18, 32, 3}));
    EXPECT_EQ(read_png(out / "mask/1x" / (name + ".png.png")).size(), 18 * 32);
    EXPECT_TRUE(fs::exists(out / "camera" / (name + ".json")));
  }
  for (const Json& id : dataset["train_ids"]) {
    EXPECT_EQ(read_png(out / "normal/1x" / (id.get<std::string>() + ".png")).shape(), Shape({18, 32, 3}));
  }
  for (const char* part : {"normal", "diffuse", "specular"}) {
    EXPECT_EQ(read_png(out / "truth" / part / "000002_right.png").shape(), Shape({18, 32, 3}));
  }
  EXPECT_EQ(read_npy(out / "truth/depth/000002_right.npy").shape(), Shape({18, 32}));
  EXPECT_EQ(read_npy(out / "points.npy").shape(), Shape({50, 3}));
  const Json scene = json_of(out / "scene.json");
  EXPECT_EQ(scene["scale"], synth_normalisation().scale);
  EXPECT_LT(scene["near"], scene["far"]);
}

TEST(SynthWrite, PicturesAreTheOnesInMemory) {
  const TempFolder temp;
  const SynthOptions options = tiny_options();
  write_synthetic_capture(options, temp / "capture");
  const SynthView view = synth_views(options)[3];
  ASSERT_EQ(view.id, "000002_right");
  const SynthImages images = synth_images(options, view);
  const Tensor<uint8_t> expected = to_8bit(images.colour);
  const Tensor<uint8_t> found = read_png(temp / "capture/rgb/1x/000002_right.png");
  EXPECT_TRUE(std::ranges::equal(found.values(), expected.values()));
  const Tensor<uint8_t> normal = read_png(temp / "capture/truth/normal/000002_right.png");
  for (int64_t i = 0; i < normal.size(); ++i) {
    ASSERT_NEAR(static_cast<float>(normal[i]) / 127.5F - 1, images.normal[i], 1.01F / 255);
  }
}

TEST(SynthWrite, MotionIsTheOneInMemory) {
  const TempFolder temp;
  SynthOptions options = tiny_options();
  options.scene = SynthScene::tumble;
  write_synthetic_capture(options, temp / "capture");
  const SynthMotion motion = synth_motion(options);
  const Tensor<float> points = read_npy(temp / "capture/truth/motion/points.npy");
  const Tensor<float> object = read_npy(temp / "capture/truth/motion/object.npy");
  ASSERT_EQ(points.shape(), motion.points.shape());
  ASSERT_EQ(points.dim(0), options.frames);
  ASSERT_EQ(object.shape(), Shape({points.dim(1)}));
  EXPECT_TRUE(std::ranges::equal(points.values(), motion.points.values()));
  EXPECT_TRUE(std::ranges::equal(object.values(), motion.object.values()));
  EXPECT_NE(bytes_of(temp / "capture/truth/motion/object.npy").find("<i4"), std::string::npos);
}

TEST(SynthWrite, CameraFileHoldsTheCamera) {
  const TempFolder temp;
  write_synthetic_capture(tiny_options(), temp / "capture");
  const SynthView view = synth_views(tiny_options())[4];
  const Json camera = json_of(temp / "capture/camera" / (view.id + ".json"));
  for (int row = 0; row < 3; ++row) {
    EXPECT_EQ(camera["position"][row], view.camera.position[row]);
    for (int column = 0; column < 3; ++column) {
      EXPECT_EQ(camera["orientation"][row][column], view.camera.camera_from_world[column][row]);
    }
  }
  EXPECT_EQ(camera["image_size"], Json::array({32, 18}));
}

TEST(SynthWrite, ReaderFindsWhatWasWritten) {
  const TempFolder temp;
  SynthOptions options = tiny_options();
  options.width = 96;
  options.height = 54;
  write_synthetic_capture(options, temp / "capture");
  const Capture capture = load_capture(temp / "capture", {});
  EXPECT_TRUE(capture.has_masks);
  EXPECT_TRUE(capture.has_normal_priors);
  EXPECT_TRUE(capture.has_truth);
  EXPECT_TRUE(capture.warnings.empty()) << capture.warnings.front().text;
  ASSERT_EQ(capture.train.size(), 6U);
  ASSERT_EQ(capture.test.size(), 1U);

  const SceneNormalisation normalisation = synth_normalisation();
  for (const SynthView& view : synth_views(options)) {
    const auto& found = view.is_test ? capture.test : capture.train;
    const auto read = std::ranges::find(found, view.id, &View::id);
    ASSERT_NE(read, found.end());
    EXPECT_FLOAT_EQ(read->time, static_cast<float>(view.time));
    const auto expected = (view.camera.position - normalisation.centre) * normalisation.scale;
    EXPECT_LT(length(Vec3<double>(read->camera.position) - expected), 1e-6);
    EXPECT_FLOAT_EQ(read->camera.focal_x, static_cast<float>(view.camera.focal_x));
  }

  const SynthImages images = synth_images(options, synth_views(options)[3]);
  const ViewTruth truth = load_truth(capture, capture.test.front());
  for (int64_t i = 0; i < images.depth.size(); ++i) {
    ASSERT_NEAR(truth.depth[i], images.depth[i] * normalisation.scale, 1e-5);
  }
  for (int64_t i = 0; i < images.normal.size(); ++i) ASSERT_NEAR(truth.normal[i], images.normal[i], 0.02);
}

TEST(SynthWrite, PriorsReadAsWorldNormals) {
  const TempFolder temp;
  SynthOptions options = tiny_options();
  options.prior_noise = 0;
  write_synthetic_capture(options, temp / "capture");
  const Capture capture = load_capture(temp / "capture", {});
  const SynthView view = synth_views(options).front();
  const SynthImages images = synth_images(options, view);
  const auto read = load_images(capture, capture.train.front());
  ASSERT_EQ(read->normal_prior.shape(), images.normal.shape());
  for (int64_t i = 0; i < images.normal.size(); ++i)
    ASSERT_NEAR(read->normal_prior[i], images.normal[i], 0.02);
  EXPECT_TRUE(std::ranges::equal(read->mask.values(), images.mask.values()));
}

TEST(SynthWrite, SecondRunReplacesTheFirstWithTheSameBytesAndLeavesNothingStale) {
  const TempFolder temp;
  SynthOptions options = tiny_options();
  write_synthetic_capture(options, temp / "once");
  options.frames = 8;
  write_synthetic_capture(options, temp / "twice");
  options.frames = 6;
  write_synthetic_capture(options, temp / "twice");
  const std::vector<std::string> names = files_below(temp / "once");
  ASSERT_EQ(names, files_below(temp / "twice"));
  for (const std::string& name : names)
    EXPECT_EQ(bytes_of(temp / "once" / name), bytes_of(temp / "twice" / name)) << name;
}

TEST(SynthWrite, RefusesFoldersThatAreNotItsOwn) {
  const TempFolder temp;
  std::ofstream(temp / "letter.txt") << "dear";
  EXPECT_THROW(write_synthetic_capture(tiny_options(), temp.path()), InputError);
  EXPECT_EQ(files_below(temp.path()), std::vector<std::string>{"letter.txt"});
  EXPECT_THROW(write_synthetic_capture(tiny_options(), temp / "letter.txt"), InputError);

  // Photographs that somebody took.
  fs::create_directories(temp / "real/rgb/1x");
  std::ofstream(temp / "real/dataset.json") << "{}";
  std::ofstream(temp / "real/rgb/1x/000000_left.png") << "precious";
  EXPECT_THROW(write_synthetic_capture(tiny_options(), temp / "real"), InputError);
  EXPECT_EQ(bytes_of(temp / "real/rgb/1x/000000_left.png"), "precious");
}

TEST(SynthWrite, WrongOptionsTouchNothing) {
  const TempFolder temp;
  SynthOptions options = tiny_options();
  options.frames = 0;
  EXPECT_THROW(write_synthetic_capture(options, temp / "capture"), InputError);
  EXPECT_FALSE(fs::exists(temp / "capture"));
}

}  // namespace
}  // namespace traceflow
