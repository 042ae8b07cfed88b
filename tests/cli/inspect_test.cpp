#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "capture/synth/synth.h"
#include "cli/program_call.h"
#include "cli/terminal/error_boundary.h"
#include "files/png.h"
#include "support/temp_folder.h"

// `inspect` on a capture that lacks a picture and a mask, and what `train` says of them.
namespace traceflow::cli {
namespace {

using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;
using Json = nlohmann::json;

class InspectVerb : public testing::Test {
 protected:
  InspectVerb() {
    SynthOptions options;
    options.frames = 5;
    options.width = 40;
    options.height = 24;
    options.samples = 2;
    options.points = 200;
    options.test_every = 2;
    write_synthetic_capture(options, folder_ / "capture");
    std::filesystem::remove(folder_ / "capture/rgb/1x/000001_left.png");
    std::filesystem::remove(folder_ / "capture/mask/1x/000002_left.png.png");
  }
  std::string capture() const { return (folder_ / "capture").string(); }

  TempFolder folder_;
};

const Json& finding(const Json& report, const std::string& kind) {
  static const Json none;
  for (const Json& f : report["findings"]) {
    if (f["kind"] == kind) return f;
  }
  return none;
}

TEST_F(InspectVerb, says_each_problem_in_a_line_with_its_paths) {
  const Outcome told = run_with({"inspect", "-d", capture()});
  EXPECT_EQ(told.code, exit_done) << told.err;
  EXPECT_THAT(told.out,
              HasSubstr("\nproblem         1 of 5 training views have no image (000001_left): left out\n"
                        "                rgb/1x/000001_left.png\n"));
  EXPECT_THAT(told.out, HasSubstr("\nproblem         1 of 4 training views have no mask (000002_left)\n"));
  EXPECT_THAT(told.out, HasSubstr("\ntrain           4 views at 4 times from "));
  EXPECT_THAT(told.out, HasSubstr("; 3 masks, 4 normal priors\n"));
  EXPECT_THAT(told.out, HasSubstr("\nmemory "));
}

TEST_F(InspectVerb, says_them_for_programs) {
  const Outcome told = run_with({"inspect", "-d", capture(), "--json", "--preset", "demo"});
  ASSERT_EQ(told.code, exit_done) << told.err;
  const Json report = Json::parse(told.out);
  EXPECT_EQ(finding(report, "missing-image")["severity"], "problem");
  EXPECT_EQ(finding(report, "missing-image")["files"], Json({"rgb/1x/000001_left.png"}));
  EXPECT_EQ(finding(report, "missing-mask")["views"], Json({"000002_left"}));
  EXPECT_EQ(finding(report, "missing-mask")["value"], nullptr);
  EXPECT_GT(report["memory"]["training_cpu_bytes"], report["memory"]["decoded_bytes"]);

  // Fewer surfels take less memory; the preset is the one that was asked for.
  const Json small = Json::parse(
      run_with({"inspect", "-d", capture(), "--json", "--preset", "demo", "--set", "density.max_surfels=100"})
          .out);
  const Json paper = Json::parse(run_with({"inspect", "-d", capture(), "--json", "--quick"}).out);
  EXPECT_LT(small["memory"]["training_cpu_bytes"], report["memory"]["training_cpu_bytes"]);
  EXPECT_GT(paper["memory"]["training_cuda_bytes"], report["memory"]["training_cuda_bytes"]);
}

TEST_F(InspectVerb, tells_the_noise_all_over_and_in_masks) {
  // Grey pictures with noise of 4 levels and, in the masks of their left half, of 12.
  Random random(2);
  Tensor<uint8_t> picture({24, 40, 3}), mask({24, 40});
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "capture/rgb/1x")) {
    for (int64_t i = 0; i < mask.size(); ++i) {
      mask[i] = i % 40 < 16 ? 255 : 0;
      for (int64_t c = 0; c < 3; ++c)
        picture[3 * i + c] = static_cast<uint8_t>(128.5 + (mask[i] != 0 ? 12 : 4) * random.normal());
    }
    write_png(entry.path(), picture);
    const std::string name = entry.path().filename().string();
    if (name != "000002_left.png") write_png(folder_ / "capture/mask/1x" / (name + ".png"), mask);
  }
  const Json noise = Json::parse(run_with({"inspect", "-d", capture(), "--json"}).out)["decoded"];
  EXPECT_NEAR(255 * noise["masked_noise"].get<double>(), 12, 1.5);
  EXPECT_GT(255 * noise["noise"].get<double>(), 4);
  EXPECT_LT(255 * noise["noise"].get<double>(), 8);
  const double decibels = -20 * std::log10(noise["masked_noise"].get<double>());
  EXPECT_THAT(run_with({"inspect", "-d", capture()}).out,
              AllOf(HasSubstr("\nnoise           up to "),
                    HasSubstr(fmt::format(" dB, {:.1f} in the masks\n", decibels))));
}

TEST_F(InspectVerb, says_that_a_budget_does_not_even_hold_the_images) {
  const auto inspected = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"inspect", "-d", capture(), "--quick"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome told = run_with(words);
    EXPECT_EQ(told.code, exit_done) << told.err;
    return told.out;
  };
  const std::string first = "option: memory_budget: found 10 MiB, expected more than ",
                    last =
                        " MiB for images of this size; raise it, use --downscale, or lower "
                        "capture.cache_mebibytes";
  EXPECT_THAT(inspected({"--memory-budget", "10"}),
              AllOf(HasSubstr("\nproblem         " + first), HasSubstr(last + "\n")));
  const Json report = Json::parse(inspected({"--memory-budget", "10", "--json"}));
  const Json& found = report["findings"][0];
  EXPECT_EQ(found["kind"], "memory");
  EXPECT_EQ(found["severity"], "problem");
  EXPECT_THAT(found["text"].get<std::string>(), AllOf(StartsWith(first), EndsWith(last)));
  // What training would take is told all the same.
  EXPECT_GT(report["memory"]["training_cpu_bytes"], int64_t{10} << 20);
  const Json enough = Json::parse(inspected({"--memory-budget", "1000000", "--json"}));
  EXPECT_EQ(finding(enough, "memory"), nullptr);
}

// Names of folders and files may hold what would clear the terminal, or write elsewhere on it.
TEST_F(InspectVerb, shows_names_without_what_commands_the_terminal) {
  const std::filesystem::path moved = folder_ / "cap\x1b[2Jture";
  std::filesystem::rename(capture(), moved);
  std::filesystem::copy(moved / "rgb/1x/000000_left.png", moved / "rgb/1x/holi\x1b]0;day\x07.png");
  const Outcome told = run_with({"inspect", "-d", moved.string(), "--quick"});
  EXPECT_EQ(told.code, exit_done) << told.err;
  EXPECT_EQ((told.out + told.err).find_first_of("\x1b\x07"), std::string::npos);
  EXPECT_THAT(told.out, HasSubstr("capture         cap?[2Jture (nerf-ds)\n"));
  EXPECT_THAT(told.out, HasSubstr("\n                rgb/1x/holi?]0;day?.png\n"));
}

TEST_F(InspectVerb, says_names_for_programs_in_ascii) {
  const std::string name =
      "holi\xc2\x9b\x7f\xe2\x80\xae"
      "day.png";  // C1, DEL, right-to-left
  std::filesystem::copy(folder_ / "capture/rgb/1x/000000_left.png", folder_ / "capture/rgb/1x" / name);
  const Outcome told = run_with({"inspect", "-d", capture(), "--json", "--quick"});
  ASSERT_EQ(told.code, exit_done) << told.err;
  for (const char c : told.out) EXPECT_TRUE(c == '\n' || (c >= 32 && c < 127));
  EXPECT_EQ(finding(Json::parse(told.out), "unregistered-image")["files"], Json({"rgb/1x/" + name}));
}

TEST_F(InspectVerb, draws_a_picture) {
  const std::string picture = (folder_ / "picture.png").string();
  ASSERT_EQ(run_with({"inspect", "-d", capture(), "--picture", picture}).code, exit_done);
  EXPECT_EQ(read_png_size(picture).width, 1200);
}

TEST_F(InspectVerb, training_says_and_logs_what_loading_found) {
  const std::string run = (folder_ / "run").string();
  const Outcome trained = run_with(
      {"train", "-d", capture(), "-o", run, "--preset", "demo", "-i", "1", "--set", "deform.network.width=16",
       "--set", "deform.environment_network.width=16", "--set", "initial.environment_cells=4"});
  ASSERT_EQ(trained.code, exit_done) << trained.err;
  EXPECT_THAT(trained.err, HasSubstr("warning: 1 of 5 training views have no image (000001_left)"));
  EXPECT_THAT(trained.err, HasSubstr("warning: 1 of 4 training views have no mask (000002_left)"));
  std::ifstream log(folder_ / "run/log.jsonl");
  std::vector<std::string> warnings;
  for (std::string line; std::getline(log, line);) {
    const Json event = Json::parse(line);
    if (event["event"] == "warning") warnings.push_back(event["text"]);
  }
  EXPECT_THAT(warnings, testing::Contains(HasSubstr("no image (000001_left)")));
  EXPECT_THAT(warnings, testing::Contains(HasSubstr("no mask (000002_left)")));
}

}  // namespace
}  // namespace traceflow::cli
