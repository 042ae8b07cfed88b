#include "record/event_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <tuple>

#include "base/error.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

using nlohmann::json;

std::vector<json> lines(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<json> result;
  for (std::string line; std::getline(file, line);) result.push_back(json::parse(line));
  return result;
}

events::Step step(int64_t iteration, int64_t iterations) {
  events::Step e;
  e.iteration = iteration;
  e.iterations = iterations;
  return e;
}

// While one stands, no file grows beyond so many bytes: what is written ends there, as on a full disk.
class SmallDisk {
 public:
  explicit SmallDisk(uintmax_t bytes) : signal_(std::signal(SIGXFSZ, SIG_IGN)) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~SmallDisk() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, signal_);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

 private:
  rlimit before_{};
  void (*signal_)(int);
};

TEST(EventLog, WritesOneLineOfJsonForEveryKindOfEvent) {
  events::Step full = step(7, 10);
  full.phase = "specular";
  full.loss = 0.5;
  full.terms = {{"l1", 0.25}, {"ssim", 1.5}};
  full.psnr = 21.5;
  full.seconds = 3;
  full.rate = 2.5;
  full.surfels = {100, 20};
  full.memory_bytes = 1 << 20;
  const TempFolder folder;
  const auto path = folder / "log.jsonl";
  {
    EventLog log(path);
    log(events::Started{"plate",
                        "runs/plate",
                        0,
                        10,
                        "cpu",
                        2,
                        42,
                        {100, 20},
                        5 << 20,
                        "1.2.3",
                        {"chip", 4, 8192, "Linux", ""},
                        90,
                        60});
    log(full);
    log(events::DensityChanged{8, "main", 1, 2, 5, 3, 4, true, false, 96});
    log(events::FollowingDecided{9, true, 0.5});
    log(events::BodiesParted{9, 1, 3});
    log(events::BendingDecided{9, 1, true, 1.5, 0.25});
    log(events::PriorsTurned{9, 3.5});
    log(events::PhaseEntered{9, "joint"});
    log(events::Evaluated{9, "test", 5, 20.25, 0.75, 1.5});
    log(events::Warning{9, "a \"quoted\"\nline"});
    log(events::Saved{10, "runs/plate/state.safetensors", 0.5});
    log(events::Measured{10, "joint", 3, {{"raster", 6, 0.25}, {"trace", 3, 0.5}}});
    log(events::Finished{events::Ending::interrupted, 10, 4, 22, {96, 20}, "SIGTERM"});
  }
  const std::vector<json> written = lines(path);
  ASSERT_EQ(written.size(), 13U);
  EXPECT_EQ(written[0], json::parse(R"({"event":"started","capture":"plate","run":"runs/plate","iteration":0,
      "iterations":10,"device":"cpu","threads":2,"seed":42,"surfels":{"main":100,"environment":20},
      "forecast_bytes":5242880,"version":"1.2.3","machine":{"processor":"chip","threads":4,"memory_bytes":8192,
      "system":"Linux","gpu":""},"points":90,"points_in_view":60})"));
  EXPECT_EQ(written[1],
            json::parse(R"({"event":"step","iteration":7,"iterations":10,"phase":"specular","loss":0.5,
      "terms":{"l1":0.25,"ssim":1.5},"psnr":21.5,"seconds":3.0,"rate":2.5,"surfels":{"main":100,"environment":20},"memory_bytes":1048576})"));
  EXPECT_EQ(
      written[2],
      json::parse(R"({"event":"density_changed","iteration":8,"set":"main","cloned":1,"split":2,"added":5,
      "pruned_transparent":3,"pruned_large":4,"opacity_reset":true,"at_cap":false,"count":96})"));
  EXPECT_EQ(written[3],
            json::parse(R"({"event":"following_decided","iteration":9,"follows":true,"silhouettes":0.5})"));
  EXPECT_EQ(written[4], json::parse(R"({"event":"bodies_parted","iteration":9,"added":1,"bodies":3})"));
  EXPECT_EQ(written[5], json::parse(R"({"event":"bending_decided","iteration":9,"body":1,"bends":true,
      "silhouettes":1.5,"photographs":0.25})"));
  EXPECT_EQ(written[6], json::parse(R"({"event":"priors_turned","iteration":9,"degrees":3.5})"));
  EXPECT_EQ(written[7], json::parse(R"({"event":"phase_entered","iteration":9,"phase":"joint"})"));
  EXPECT_EQ(written[8],
            json::parse(R"({"event":"evaluated","iteration":9,"split":"test","views":5,"psnr":20.25,
      "ssim":0.75,"seconds":1.5})"));
  EXPECT_EQ(written[9]["text"], "a \"quoted\"\nline");
  EXPECT_EQ(written[10], json::parse(R"({"event":"saved","iteration":10,"path":"runs/plate/state.safetensors",
      "seconds":0.5})"));
  EXPECT_EQ(written[11], json::parse(R"({"event":"measured","iteration":10,"phase":"joint","iterations":3,
      "steps":[{"name":"raster","calls":6,"seconds":0.25},{"name":"trace","calls":3,"seconds":0.5}]})"));
  EXPECT_EQ(written[12],
            json::parse(R"({"event":"finished","ending":"interrupted","iteration":10,"seconds":4.0,
      "psnr":22.0,"surfels":{"main":96,"environment":20},"reason":"SIGTERM"})"));
}

TEST(EventLog, AppendsAndThinsStepsButKeepsTheLast) {
  const TempFolder folder;
  const auto path = folder / "log.jsonl";
  for (int session = 0; session < 2; ++session) {
    EventLog log(path, 3);
    for (int64_t i = 1; i <= 7; ++i) log(step(i, 7));
    log(events::PhaseEntered{7, "joint"});
  }
  std::vector<int64_t> iterations;
  for (const json& line : lines(path)) iterations.push_back(line["iteration"]);
  EXPECT_EQ(iterations, (std::vector<int64_t>{3, 6, 7, 7, 3, 6, 7, 7}));
}

TEST(EventLog, CutsOffHalfALineThatAKilledRunLeft) {
  const TempFolder folder;
  const auto path = folder / "log.jsonl";
  const std::string whole = to_json_line(step(1, 9)) + "\n";
  // Nothing but half a line, half a line after a whole one, one longer than a block, none.
  for (const std::string& before : {std::string(), whole}) {
    for (const std::string& torn :
         {std::string("{\"event\":\"st"), std::string(10'000, 'x'), std::string()}) {
      std::ofstream(path) << before << torn;
      EventLog{path}(step(2, 9));
      const std::vector<json> written = lines(path);
      ASSERT_EQ(written.size(), before.empty() ? 1U : 2U);
      EXPECT_EQ(written.back()["iteration"], 2);
    }
  }
}

TEST(EventLog, WritesNullForWhatIsNotFinite) {
  events::Step diverged = step(1, 1);
  diverged.loss = std::nan("");
  diverged.psnr = INFINITY;
  const json line = json::parse(to_json_line(diverged));
  EXPECT_TRUE(line["loss"].is_null());
  EXPECT_TRUE(line["psnr"].is_null());
}

TEST(EventLog, TextThatIsNotUtf8StillMakesALine) {
  EXPECT_NO_THROW(std::ignore = json::parse(to_json_line(events::Warning{0, "\xFF"})));
}

TEST(EventLog, ADiskThatIsFullLosesWholeLinesWhichAreCountedWhenThereIsRoom) {
  const TempFolder folder;
  const auto path = folder / "log.jsonl";
  EventLog log(path);
  log(step(1, 9));
  const std::string first = bytes_of(path);
  for (const uintmax_t room : {0, 1, 10}) {
    SCOPED_TRACE(room);
    const SmallDisk disk(first.size() + room);
    log(step(2, 9));
    EXPECT_EQ(bytes_of(path), first);
  }
  log(step(3, 9));
  log(step(4, 9));
  const std::vector<json> written = lines(path);
  ASSERT_EQ(written.size(), 4U);
  EXPECT_EQ(written[1]["event"], "warning");
  EXPECT_EQ(written[1]["text"], "3 lines of the log could not be written here");
  EXPECT_EQ(written[2]["iteration"], 3);
  EXPECT_EQ(written[3]["iteration"], 4);
}

// Room for the count of what is missing, and for no more.
TEST(EventLog, ALineLostAfterTheCountIsCountedAgain) {
  const TempFolder folder;
  const auto path = folder / "log.jsonl";
  EventLog log(path);
  {
    const SmallDisk disk(0);
    for (const int i : {1, 2}) log(step(i, 9));
  }
  const auto gap = [](const std::string& count) {
    return to_json_line(events::Warning{0, count + " of the log could not be written here"}) + "\n";
  };
  {
    const SmallDisk disk(gap("2 lines").size());
    log(step(3, 9));
  }
  log(step(4, 9));
  EXPECT_EQ(bytes_of(path), gap("2 lines") + gap("1 line") + to_json_line(step(4, 9)) + "\n");
}

TEST(EventLog, RefusesAPlaceThatCannotBeWritten) {
  EXPECT_THROW(EventLog("/nowhere/at/all/log.jsonl"), InputError);
}

TEST(EventLog, WritesToNothingThatALinkLeadsTo) {
  const TempFolder folder;
  write_bytes(folder / "letter", "dear all");
  std::filesystem::create_symlink(folder / "letter", folder / "log.jsonl");
  EXPECT_THAT(refusal_of([&] { EventLog(folder / "log.jsonl", 1); }),
              testing::HasSubstr("log.jsonl: found a link, expected a place to write the log; remove it"));
  EXPECT_EQ(bytes_of(folder / "letter"), "dear all");
}

TEST(EventStream, CallsListenersInOrder) {
  std::string heard;
  events::Stream stream;
  stream.listen([&](const events::Event&) { heard += "a"; });
  stream.listen(
      [&](const events::Event& e) { heard += std::holds_alternative<events::Step>(e) ? "s" : "f"; });
  stream.emit(events::Step{});
  stream.emit(events::Finished{});
  EXPECT_EQ(heard, "asaf");
}

}  // namespace
}  // namespace traceflow
