#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>

#include "capture/synth/synth.h"
#include "cli/program_call.h"
#include "cli/terminal/error_boundary.h"
#include "files/npy.h"
#include "files/png.h"
#include "support/device.h"
#include "support/file_bytes.h"

// The verbs with --device cuda, from their arguments to the files they leave.
namespace traceflow::cli {
namespace {

using ::testing::HasSubstr;

class VerbsOnDevice : public traceflow::testing::OnDevice {
 protected:
  void SetUp() override {
    OnDevice::SetUp();
    std::filesystem::remove_all(folder_);
    SynthOptions options;
    options.frames = 5;
    options.width = 40;
    options.height = 24;
    options.samples = 2;
    options.points = 200;
    options.test_every = 2;
    write_synthetic_capture(options, folder_ / "capture");
  }
  void TearDown() override {
    std::filesystem::remove_all(folder_);
    memory::set_device_budget(std::numeric_limits<size_t>::max());
    cuda::set_deterministic(false);
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  int run_verb(std::vector<std::string> words) {
    Outcome outcome = run_with(std::move(words));
    error_ = std::move(outcome.err);
    return outcome.code;
  }
  int train(const std::string& run, const std::string& device, std::vector<std::string> more = {}) {
    std::vector<std::string> words{"train",
                                   "-d",
                                   path("capture"),
                                   "-o",
                                   path(run),
                                   "--preset",
                                   "demo",
                                   "-i",
                                   "12",
                                   "--device",
                                   device,
                                   "--set",
                                   "deform.network.width=16",
                                   "--set",
                                   "deform.environment_network.width=16",
                                   "--set",
                                   "initial.environment_cells=4"};
    words.insert(words.end(), more.begin(), more.end());
    return run_verb(std::move(words));
  }
  std::string text_of(const std::string& name) const { return bytes_of(path(name)); }

  std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) / ("verbs_on_device_" + std::to_string(::getpid()));
  std::string error_;
};

TEST_F(VerbsOnDevice, TrainEvaluateAndRenderAsOnTheCpu) {
  // In bf16 a hidden value that rounds to its other neighbour moves surfels by more than pictures may differ.
  ASSERT_EQ(train("run", "auto", {"--set", "render.precision=fp32"}), exit_done) << error_;
  EXPECT_THAT(error_, HasSubstr("device: cuda, "));
  EXPECT_THAT(text_of("run/log.jsonl"), HasSubstr(R"("device":"cuda")"));

  ASSERT_EQ(run_verb({"eval", path("run"), "--device", "cuda", "--contact-sheet", path("sheet.png")}),
            exit_done)
      << error_;
  const std::string metrics = text_of("run/eval/test/metrics.json");
  EXPECT_THAT(metrics, HasSubstr(R"("device": "cuda")"));
  EXPECT_TRUE(std::filesystem::exists(path("sheet.png")));

  for (const std::string device : {"cpu", "cuda"}) {
    ASSERT_EQ(run_verb({"render", path("run"), "-o", path(device), "--device", device, "--format", "npy",
                        "--layers", "rgb,specular,depth"}),
              exit_done)
        << error_;
  }
  for (const auto& entry : std::filesystem::recursive_directory_iterator(path("cpu"))) {
    if (!entry.is_regular_file()) continue;
    const Tensor<float> expected = read_npy(entry.path()),
                        found =
                            read_npy(folder_ / "cuda" / std::filesystem::relative(entry.path(), path("cpu")));
    ASSERT_EQ(found.shape(), expected.shape());
    int64_t differ = 0;
    for (int64_t i = 0; i < found.size(); ++i) differ += std::abs(found[i] - expected[i]) > 1e-3F ? 1 : 0;
    EXPECT_LE(differ, found.size() / 500) << entry.path();
  }

  ASSERT_EQ(run_verb({"export", path("run"), "-o", path("ply")}), exit_done) << error_;
  Tensor<float> rays({2, 6});
  for (int64_t i = 0; i < 2; ++i) rays(i, 5) = 1;
  write_npy(path("rays.npy"), rays);
  for (const std::string device : {"cpu", "cuda"}) {
    ASSERT_EQ(run_verb({"trace", path("ply/environment.ply"), "--rays", path("rays.npy"), "-o",
                        path("traced_" + device), "--device", device}),
              exit_done)
        << error_;
  }
  traceflow::testing::expect_close(read_npy(path("traced_cuda/colour.npy")),
                                   read_npy(path("traced_cpu/colour.npy")), 1e-4, "traced");
}

TEST_F(VerbsOnDevice, ARunThatTheDeviceCannotHoldIsRefusedBeforeItStarts) {
  EXPECT_EQ(train("none", "cuda", {"--memory-budget", "100"}), exit_input);
  EXPECT_THAT(error_, HasSubstr("memory_budget"));
  EXPECT_FALSE(std::filesystem::exists(path("none")));
}

}  // namespace
}  // namespace traceflow::cli
