#include "cli/program_call.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "base/parallel.h"
#include "cli/terminal/error_boundary.h"
#include "files/npy.h"
#include "primitives/instructions.h"
#include "splat/ply.h"

namespace traceflow::cli {
namespace {

using ::testing::HasSubstr;

int lines(const std::string& text) { return static_cast<int>(std::count(text.begin(), text.end(), '\n')); }

TEST(Program, SaysItsVersion) {
  const Outcome o = run_with({"--version"});
  EXPECT_EQ(o.code, exit_done);
  EXPECT_THAT(o.out, testing::MatchesRegex("traceflow [0-9]+\\.[0-9]+\\.[0-9]+\n.*"));
  for (const char* part :
       {"\ncompiler: ", "fmt [0-9.]+, ", "oneDNN [0-9.]+, ", "\ninstructions: ", "\nCUDA: "})
    EXPECT_THAT(o.out, testing::ContainsRegex(part));
  EXPECT_THAT(o.out, HasSubstr("\ninstructions: " + instructions_in_use() + "\n"));
}

TEST(Program, HelpNamesEveryVerbAndEveryVerbHasHelp) {
  const Outcome o = run_with({"--help"});
  EXPECT_EQ(o.code, exit_done);
  for (const char* verb : {"eval", "export", "inspect", "render", "synth", "trace", "train"}) {
    EXPECT_THAT(o.out, HasSubstr(std::string("\n  ") + verb + " "));
    const Outcome help = run_with({verb, "--help"});
    EXPECT_EQ(help.code, exit_done);
    EXPECT_THAT(help.out, HasSubstr(std::string("traceflow ") + verb));
  }
}

TEST(Program, ArgumentsThatCannotBeUsedAreOneLineAndCode2) {
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"fly"},
                                             {"--threads", "many"},
                                             {"train"},
                                             {"train", "-o", "x", "--no-such-flag"},
                                             {"train", "-o", "x", "--set", "loss.nromal=1"},
                                             {"train", "-o", "x", "-d", "y", "--set", "loss.lpips=1"},
                                             {"train", "-d", "/nowhere", "-o", "/tmp/traceflow_no_run"},
                                             {"inspect", "-d", "/nowhere"}}) {
    const Outcome o = run_with(arguments);
    EXPECT_EQ(o.code, exit_input) << arguments.back();
    EXPECT_EQ(lines(o.err), 1) << o.err;
    EXPECT_THAT(o.err, testing::StartsWith("traceflow: "));
    EXPECT_EQ(o.out, "");
  }
}

// This test's program is linked without the CUDA code.
TEST(Program, CudaWhereThereIsNoneIsOneLineAndAutoSaysWhatRuns) {
  const auto folder = std::filesystem::path(testing::TempDir()) / ("no_cuda_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  const std::string ply = (folder / "one.ply").string(), rays = (folder / "rays.npy").string(),
                    output = (folder / "out").string();
  Surfels surfels{Tensor<float>({1, 3}), Tensor<float>({1, 2}),    Tensor<float>({1, 4}),
                  Tensor<float>({1}),    Tensor<float>({1, 1, 3}), Tensor<float>()};
  surfels.rotation(0, 0) = 1;
  write_ply(ply, {surfels, {}});
  write_npy(rays, Tensor<float>({1, 6}));
  const Outcome refused = run_with({"trace", ply, "--rays", rays, "-o", output, "--device", "cuda"});
  EXPECT_EQ(refused.code, exit_input);
  EXPECT_EQ(lines(refused.err), 1) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("built without CUDA"));
  const Outcome taken = run_with({"trace", ply, "--rays", rays, "-o", output});
  EXPECT_EQ(taken.code, exit_done);
  EXPECT_THAT(taken.err, HasSubstr("device: cpu, "));
  EXPECT_THAT(taken.err, HasSubstr("no CUDA: this program was built without CUDA"));
  std::filesystem::remove_all(folder);
}

TEST(Program, WithoutAVerbShowsTheHelpAndFails) {
  const Outcome o = run_with({});
  EXPECT_EQ(o.code, exit_input);
  EXPECT_THAT(o.err, HasSubstr("Usage"));
}

TEST(Program, ThreadsAreSetBeforeTheVerbRunsOnEitherSideOfItsName) {
  run_with({"--threads", "3", "inspect", "-d", "/nowhere"});
  EXPECT_EQ(thread_count(), 3);
  run_with({"inspect", "-d", "/nowhere", "--threads", "2"});
  EXPECT_EQ(thread_count(), 2);
  set_threads(0);
}

TEST(Program, UnknownOptionsAreAnsweredWithTheNearest) {
  EXPECT_THAT(run_with({"train", "-o", "x", "--set", "loss.nromal=1"}).err,
              HasSubstr("did you mean loss.normal?"));
}

}  // namespace
}  // namespace traceflow::cli
