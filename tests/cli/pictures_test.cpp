#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>

#include "cli/program_call.h"
#include "cli/terminal/error_boundary.h"
#include "files/npy.h"
#include "files/png.h"
#include "splat/ply.h"

// The verbs that need no capture, from their arguments to the files they leave.
namespace traceflow::cli {
namespace {

using testing::HasSubstr;

class Pictures : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_);
    write_ply(path("one.ply"), {one_surfel(), {}});
    std::ofstream(path("cameras.json")) << R"([
      {"img_name": "left/a", "width": 33, "height": 25, "position": [0, 0, -2], "fx": 40, "fy": 40,
       "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]},
      {"id": 7, "width": 33, "height": 25, "position": [0, 0, -4], "fx": 40, "fy": 40,
       "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}])";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  // One wide, nearly opaque surfel at the origin that faces −z, red from all sides.
  static Surfels one_surfel() {
    Surfels s{Tensor<float>(Shape{1, 3}), Tensor<float>(Shape{1, 2}),    Tensor<float>(Shape{1, 4}),
              Tensor<float>(Shape{1}),    Tensor<float>(Shape{1, 1, 3}), Tensor<float>(Shape{1})};
    s.log_scale.fill(std::log(0.5F));
    s.rotation(0, 0) = 2;
    s.opacity_logit[0] = std::log(0.9F / 0.1F);
    s.sh(0, 0, 0) = static_cast<float>(0.5 / 0.28209479177387814);
    s.sh(0, 0, 1) = s.sh(0, 0, 2) = -s.sh(0, 0, 0);
    s.tint_logit[0] = std::log(0.25F / 0.75F);
    return s;
  }

  int run_verb(std::vector<std::string> words) {
    Outcome outcome = run_with(std::move(words));
    error_ = std::move(outcome.err);
    return outcome.code;
  }

  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("traceflow-pictures-" + std::to_string(::getpid()));
  std::string error_;
};

TEST_F(Pictures, RenderWritesLayersUnderTheViewsNames) {
  ASSERT_EQ(run_verb({"render", path("one.ply"), "--cameras", path("cameras.json"), "-o", path("out"),
                      "--layers", "all", "--format", "npy", "--background", "0,1,0"}),
            exit_done)
      << error_;
  // The middle pixel's ray goes through the surfel's centre.
  const auto at = [&](const std::string& layer, const std::string& name) {
    return read_npy(path("out/" + layer + "/" + name + ".npy"));
  };
  const Tensor<float> rgb = at("rgb", "left/a");
  ASSERT_EQ(rgb.shape(), (Shape{25, 33, 3}));
  EXPECT_NEAR(rgb(12, 16, 0), 0.9, 1e-4);
  EXPECT_NEAR(rgb(12, 16, 1), 0.1, 1e-4);
  EXPECT_NEAR(at("alpha", "left/a")(12, 16), 0.9, 1e-4);
  EXPECT_NEAR(at("tint", "left/a")(12, 16), 0.9 * 0.25, 1e-4);
  EXPECT_NEAR(at("depth", "left/a")(12, 16), 2, 1e-4);
  EXPECT_NEAR(at("depth", "7")(12, 16), 4, 1e-4);
  EXPECT_NEAR(at("median-depth", "7")(12, 16), 4, 1e-4);
  EXPECT_NEAR(at("normal", "left/a")(12, 16, 2), -0.9, 1e-4)
      << "world axes, turned to the camera, as blended";
  EXPECT_EQ(at("specular", "left/a")(12, 16, 0), 0);
  EXPECT_EQ(at("distortion", "left/a")(12, 16), 0);
  EXPECT_EQ(at("diffuse", "left/a")(12, 16, 0), rgb(12, 16, 0));
  const Tensor<float> tracks = at("tracks", "left/a");
  ASSERT_EQ(tracks.shape(), rgb.shape());
  EXPECT_TRUE(std::equal(rgb.values().begin(), rgb.values().end(), tracks.values().begin()))
      << "nothing moves";
}

TEST_F(Pictures, RenderWritesPngsByDefault) {
  ASSERT_EQ(run_verb({"render", path("one.ply"), "--cameras", path("cameras.json"), "-o", path("out")}),
            exit_done);
  const Tensor<uint8_t> picture = read_png(path("out/rgb/7.png"));
  EXPECT_EQ(picture.shape(), (Shape{25, 33, 3}));
  EXPECT_EQ(picture(12, 16, 0), 230);
}

TEST_F(Pictures, APlyReflectsAnother) {
  // A second surfel behind the camera, blue, that the mirror shows.
  Surfels behind = one_surfel();
  behind.position(0, 2) = -9;
  behind.log_scale.fill(2);
  std::swap(behind.sh(0, 0, 0), behind.sh(0, 0, 2));
  write_ply(path("behind.ply"), {behind, {}});
  ASSERT_EQ(
      run_verb({"render", path("one.ply"), "--environment", path("behind.ply"), "--cameras",
                path("cameras.json"), "-o", path("out"), "--format", "npy", "--layers", "rgb,specular"}),
      exit_done)
      << error_;
  const Tensor<float> specular = read_npy(path("out/specular/7.npy")), rgb = read_npy(path("out/rgb/7.npy"));
  EXPECT_NEAR(specular(12, 16, 2), 0.9, 1e-3);
  const double tint = 0.9 * 0.25;
  EXPECT_NEAR(rgb(12, 16, 0), (1 - tint) * 0.9, 1e-3);
  EXPECT_NEAR(rgb(12, 16, 2), tint * 0.9, 1e-3);
}

TEST_F(Pictures, TraceBlendsAlongRays) {
  Tensor<float> rays(Shape{3, 6});
  const float rows[3][6] = {{0, 0, -2, 0, 0, 2}, {0.5F, 0, -2, 0, 0, 1}, {0, 0, -2, 0, 0, -1}};
  std::copy(&rows[0][0], &rows[0][0] + 18, rays.data());
  write_npy(path("rays.npy"), rays);
  ASSERT_EQ(run_verb({"trace", path("one.ply"), "--rays", path("rays.npy"), "-o", path("out")}), exit_done)
      << error_;
  const Tensor<float> colour = read_npy(path("out/colour.npy"));
  const Tensor<float> alpha = read_npy(path("out/alpha.npy"));
  const Tensor<float> distance = read_npy(path("out/distance.npy"));
  ASSERT_EQ(colour.shape(), (Shape{3, 3}));
  ASSERT_EQ(alpha.shape(), (Shape{3}));
  EXPECT_NEAR(alpha[0], 0.9, 1e-5);
  EXPECT_NEAR(distance[0], 1, 1e-5) << "in units of the direction's length";
  EXPECT_NEAR(alpha[1], 0.9 * std::exp(-0.5), 1e-5) << "one standard deviation out";
  EXPECT_NEAR(distance[1], 2, 1e-5);
  EXPECT_NEAR(colour(1, 0), 0.9 * std::exp(-0.5), 1e-5);
  EXPECT_EQ(alpha[2], 0);
  EXPECT_EQ(distance[2], 0);
  ASSERT_EQ(
      run_verb({"trace", path("one.ply"), "--rays", path("rays.npy"), "-o", path("out"), "--t-min", "2.5"}),
      0);
  EXPECT_EQ(read_npy(path("out/alpha.npy"))[0], 0) << "the surfel is 2 scene units away";
}

TEST_F(Pictures, BadArgumentsGetOneLineAndExitCode2) {
  const std::string ply = path("one.ply"), cameras = path("cameras.json"), out = path("out");
  write_npy(path("narrow.npy"), Tensor<float>(Shape{2, 5}));
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"render", ply, "-o", out}, "--cameras"},
      {{"render", ply, "--cameras", cameras}, "-o DIR"},
      {{"render", path("none"), "-o", out}, "no such"},
      {{"render", path("."), "-o", out}, "checkpoint"},
      {{"render", ply, "--cameras", cameras, "-o", out, "--layers", "colour"}, "layers"},
      {{"render", ply, "--cameras", cameras, "-o", out, "--layers", "tracks", "--tracks-frames", "0"},
       "tracks_frames"},
      {{"render", ply, "--cameras", cameras, "-o", out, "--time", "nan"}, "time"},
      {{"render", ply, "--cameras", cameras, "-o", out, "--background", "1,1"}, "background"},
      {{"render", ply, "--cameras", ply, "-o", out}, "JSON"},
      {{"render", cameras, "--cameras", cameras, "-o", out}, "ply"},
      {{"render", ply, "--orbit", "--size", "0x9", "-o", out}, "size"},
      {{"trace", ply, "--rays", path("narrow.npy"), "-o", out}, "Nx6"},
      {{"trace", ply, "--rays", cameras, "-o", out}, "npy"},
      {{"eval", folder_.string()}, "checkpoint"},
      {{"export", folder_.string(), "-o", out}, "checkpoint"},
  };
  for (const auto& [words, part] : cases) {
    EXPECT_EQ(run_verb(words), exit_input) << words[0] << " " << part;
    EXPECT_THAT(error_, HasSubstr(part));
    EXPECT_EQ(std::count(error_.begin(), error_.end(), '\n'), 1) << error_;
  }
  EXPECT_FALSE(std::filesystem::exists(out)) << "nothing is written before the arguments hold";
}

}  // namespace
}  // namespace traceflow::cli
