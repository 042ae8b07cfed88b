#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

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

TEST_F(ExportVerb, WrongArgumentsGetOneLineAndExitCode2) {
  const auto refuses = [&](const std::vector<std::string>& words, const std::string& text) {
    const Outcome o = export_run(words);
    EXPECT_EQ(o.code, exit_input);
    EXPECT_THAT(o.err, HasSubstr(text));
    EXPECT_FALSE(std::filesystem::exists(path("out")));
  };
  refuses({"--bake"},
          "option: bake: found it with --format 2dgs, which has reflections, expected 3dgs, spz or sog");
  refuses({"--times", "1"}, "option: times: found 1, expected all, or a number from 2 to 10000");
  refuses({"--times", "2x"}, "option: times: found 2x");
  refuses({"--times", "2", "--time", "0.5"}, "--time");
  refuses({"--format", "splat"}, "--format");
}

}  // namespace
}  // namespace traceflow::cli
