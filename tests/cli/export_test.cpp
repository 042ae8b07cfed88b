#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "cli/malformed_cases.h"
#include "cli/program_call.h"
#include "cli/terminal/error_boundary.h"
#include "files/png.h"
#include "splat/splat_file.h"
#include "support/file_bytes.h"
#include "support/temp_folder.h"

// The verb export, from a small run to files that the program reads again.
namespace traceflow::cli {
namespace {

using testing::HasSubstr;

class ExportVerb : public testing::Test {
 protected:
  void SetUp() override {
    for (const auto& [name, bytes] : good_files()) {
      std::filesystem::create_directories((folder_ / name).parent_path());
      write_bytes(folder_ / name, bytes);
    }
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  Outcome export_run(std::vector<std::string> words) const {
    words.insert(words.begin(), {"export", path("run"), "-o", path("out")});
    return run_with(words);
  }

  TempFolder folder_;
};

TEST_F(ExportVerb, FilesOfAllFormatsButSogRenderAgain) {
  for (const auto& [format, file] :
       {std::pair("2dgs", "main.ply"), {"3dgs", "main.ply"}, {"spz", "main.spz"}}) {
    const Outcome exported = export_run({"--format", format});
    ASSERT_EQ(exported.code, exit_done) << exported.err;
    EXPECT_EQ(exported.out.substr(0, exported.out.find('\n')), path(std::string("out/") + file));
    const Outcome rendered = run_with({"render", path(std::string("out/") + file), "--cameras",
                                       path("cameras.json"), "-o", path("pictures")});
    EXPECT_EQ(rendered.code, exit_done) << rendered.err;
    EXPECT_EQ(rendered.err.find("holds 3D Gaussians") != std::string::npos, std::string(format) != "2dgs");
    std::filesystem::remove_all(folder_ / "out");
  }
  EXPECT_EQ(export_run({"--format", "sog"}).code, exit_done);
  EXPECT_EQ(bytes_of(path("out/main.sog")).substr(0, 2), "PK");
}

// An .spz stores no extent, so neither does what is written of it.
TEST_F(ExportVerb, AnSpzBecomesA2dgsFileThatRenders) {
  ASSERT_EQ(run_with({"export", path("scene.spz"), "-o", path("out")}).code, exit_done);
  const Outcome o =
      run_with({"render", path("out/main.ply"), "--cameras", path("cameras.json"), "-o", path("pictures")});
  EXPECT_EQ(o.code, exit_done) << o.err;
}

TEST_F(ExportVerb, SeveralTimesAreNumberedFiles) {
  ASSERT_EQ(export_run({"--times", "3"}).code, exit_done);
  EXPECT_TRUE(std::filesystem::exists(path("out/main_0002.ply")));
  EXPECT_FALSE(std::filesystem::exists(path("out/main_0003.ply")));
  const Outcome one = run_with({"export", path("run"), "-o", path("one"), "--time", "0.5"});
  ASSERT_EQ(one.code, exit_done);
  const auto position = [&](const char* file) { return read_splat_file(path(file)).surfels.position; };
  const Tensor<float> a = position("one/main.ply"), b = position("out/main_0001.ply");
  EXPECT_TRUE(a.shape() == b.shape() && std::equal(a.data(), a.data() + a.size(), b.data()));

  EXPECT_EQ(
      run_with({"export", path("run"), "-o", path("all"), "--times", "all", "-d", path("capture")}).code,
      exit_done);
  EXPECT_TRUE(std::filesystem::exists(path("all/main_0000.ply")));
}

TEST_F(ExportVerb, BakingReportsItsError) {
  const Outcome o = export_run({"--format", "3dgs", "--bake", "-d", path("capture")});
  ASSERT_EQ(o.code, exit_done) << o.err;
  EXPECT_THAT(o.out, HasSubstr("dB against the images with reflections"));
  EXPECT_THAT(o.out, HasSubstr("(1 cameras, time 0.000)"));
  EXPECT_EQ(read_splat_file(path("out/main.ply")).surfels.sh.dim(1), 16);
}

// A wide surfel across the training camera's view, 2 before it: the mesh is a flat piece there.
TEST_F(ExportVerb, AMeshOfASurfelIsFlat) {
  Surfels s{Tensor<float>({1, 3}), Tensor<float>({1, 2}),    Tensor<float>({1, 4}),
            Tensor<float>({1}),    Tensor<float>({1, 1, 3}), Tensor<float>()};
  s.position(0, 2) = 1;
  s.rotation(0, 0) = 1;
  s.log_scale.fill(1);
  s.opacity_logit[0] = 5;
  write_ply(folder_ / "wide.ply", {s, {}});
  const Outcome o = run_with({"export", path("wide.ply"), "-o", path("out"), "--format", "mesh", "-d",
                              path("capture"), "--set", "mesh.voxel=0.05", "--set", "mesh.min_triangles=1"});
  ASSERT_EQ(o.code, exit_done) << o.err;
  EXPECT_THAT(o.out, HasSubstr("triangles"));
  const std::string ply = bytes_of(path("out/mesh.ply"));
  EXPECT_THAT(ply.substr(0, 400), HasSubstr("element face"));
  const size_t begin = ply.find("end_header\n") + 11;
  for (int i = 0; i < 10; ++i) {
    float vertex[3];
    std::memcpy(vertex, ply.data() + begin + static_cast<size_t>(27 * i), sizeof vertex);
    EXPECT_NEAR(vertex[2], 1, 0.01);
  }
  EXPECT_EQ(bytes_of(path("out/mesh.glb")).substr(0, 4), "glTF");
}

TEST_F(ExportVerb, NoTrajectoriesWithoutMotion) {
  const Outcome o = run_with(
      {"export", path("scene.spz"), "-o", path("out"), "--format", "trajectories", "-d", path("capture")});
  EXPECT_EQ(o.code, exit_input);
  EXPECT_THAT(o.err, HasSubstr("trajectories: found no surfel that moves, expected at least one"));
  EXPECT_FALSE(std::filesystem::exists(path("out")));
}

TEST_F(ExportVerb, WrongArgumentsGetOneLineAndExitCode2) {
  const auto refuses = [&](const std::vector<std::string>& words, const std::string& text) {
    const Outcome o = export_run(words);
    EXPECT_EQ(o.code, exit_input);
    EXPECT_THAT(o.err, HasSubstr(text));
    EXPECT_FALSE(std::filesystem::exists(path("out")));
  };
  refuses({"--bake"}, "option: bake: found it with --format 2dgs, expected it with 3dgs, spz or sog");
  refuses({"--bake", "--format", "mesh"}, "option: bake: found it with --format mesh");
  refuses({"--undeformed", "--format", "mesh"}, "option: undeformed: found it with --format mesh");
  refuses({"--times", "2", "--format", "trajectories"},
          "option: times: found it with --format trajectories, expected neither");
  refuses({"--format", "trajectories", "--tracks-most", "0"}, "tracks_most: found 0");
  refuses({"--format", "mesh", "--set", "mesh.voxel=-1"}, "mesh.voxel: found -1");
  refuses({"--times", "1"}, "option: times: found 1, expected all, or a number from 2 to 10000");
  refuses({"--times", "2x"}, "option: times: found 2x");
  refuses({"--times", "2", "--time", "0.5"}, "--time");
  refuses({"--format", "splat"}, "--format");
}

}  // namespace
}  // namespace traceflow::cli
