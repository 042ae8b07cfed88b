#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "capture/capture.h"
#include "capture/synth/synth.h"
#include "cli/program_call.h"
#include "cli/terminal/error_boundary.h"
#include "files/png.h"
#include "support/file_bytes.h"
#include "support/temp_folder.h"

// `train` on a film whose first masks are missing.
namespace traceflow::cli {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

std::vector<std::string> with(std::vector<std::string> words, const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST(TrainWithoutMasks, FindsThemAndResumesWithThem) {
  const TempFolder folder;
  SynthOptions options;
  options.scene = SynthScene::tumble;
  options.frames = 12;
  options.width = 40;
  options.height = 24;
  options.samples = 1;
  options.points = 1500;
  const fs::path capture = folder / "capture", run = folder / "run";
  write_synthetic_capture(options, capture);
  const std::vector<View> views = load_capture(capture, {}).train;
  const std::vector<std::string> ids = {views[0].id, views[1].id};
  for (const std::string& id : ids) fs::remove(capture / "mask/1x" / (id + ".png.png"));

  const std::vector<std::string> train = {
      "train", "-d",    capture.string(),           "-o",         run.string(), "--preset", "cpu", "-i",
      "500",   "--set", "density.max_surfels=1500", "--specular", "none"};
  const Outcome first = run_with(train);
  ASSERT_EQ(first.code, exit_done) << first.err;
  EXPECT_THAT(first.err, HasSubstr("found what moves in 2 pictures without masks: "));
  for (const std::string& id : ids) {
    const PngSize size = read_png_size(run / "masks" / (id + ".png"));
    EXPECT_EQ(size.width, 40);
    EXPECT_EQ(size.height, 24);
  }

  std::vector<std::string> resume = with(train, {"--resume"});
  resume[8] = "501";
  fs::copy(run, folder / "copy", fs::copy_options::recursive);
  const Outcome second = run_with(resume);
  EXPECT_EQ(second.code, exit_done) << second.err;
  EXPECT_THAT(second.err, Not(HasSubstr("found what moves")));

  // Without them the run is refused, and stays as it is.
  resume[4] = (folder / "copy").string();
  fs::remove_all(folder / "copy/masks");
  const std::string before = bytes_of(folder / "copy/checkpoint.safetensors");
  const Outcome third = run_with(resume);
  EXPECT_EQ(third.code, exit_input);
  EXPECT_THAT(third.err, HasSubstr("copy/masks: found 0 masks, expected the 2 that the run found"));
  EXPECT_TRUE(bytes_of(folder / "copy/checkpoint.safetensors") == before);
}

}  // namespace
}  // namespace traceflow::cli
