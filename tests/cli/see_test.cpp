#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "capture/synth/synth.h"
#include "cli/program_call.h"
#include "cli/terminal/count_progress.h"
#include "cli/terminal/error_boundary.h"
#include "files/png.h"
#include "files/safetensors.h"
#include "runs/loaded_scene.h"
#include "support/file_bytes.h"

// `report`, `eval`'s page and the films of `render`, from a run's folder to the files they leave.
namespace traceflow::cli {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using Json = nlohmann::json;

const fs::path& folder() {
  static const fs::path path = fs::path(testing::TempDir()) / ("traceflow-see-" + std::to_string(::getpid()));
  return path;
}
std::string path(const std::string& name) { return (folder() / name).string(); }

Json data_of(const fs::path& page) {
  const std::string html = bytes_of(page), before = R"(id="report">)";
  const size_t begin = html.find(before) + before.size();
  return Json::parse(html.substr(begin, html.find('<', begin) - begin));
}

std::set<std::string> names_in(const fs::path& directory) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(directory)) names.insert(entry.path().filename().string());
  return names;
}

// A small run, made once: eleven iterations, then resumed to fourteen.
class See : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    fs::remove_all(folder());
    SynthOptions options;
    options.frames = 5;
    options.width = 40;
    options.height = 24;
    options.samples = 2;
    options.points = 200;
    options.test_every = 2;
    write_synthetic_capture(options, folder() / "capture");
    std::vector<std::string> train = {"train",
                                      "-d",
                                      path("capture"),
                                      "-o",
                                      path("run"),
                                      "--preset",
                                      "demo",
                                      "--set",
                                      "deform.network.width=16",
                                      "--set",
                                      "deform.environment_network.width=16",
                                      "--set",
                                      "initial.environment_cells=4",
                                      "-q",
                                      "-i"};
    train.emplace_back("11");
    ASSERT_EQ(run_with(train).code, exit_done);
    train.back() = "14";
    train.emplace_back("--resume");
    ASSERT_EQ(run_with(train).code, exit_done);
  }
  static void TearDownTestSuite() { fs::remove_all(folder()); }
};

TEST_F(See, ReportTellsAllThatIsKnownOfTheRun) {
  const Outcome made = run_with({"report", path("run") + "/", "-o", path("pages/page.html")});
  ASSERT_EQ(made.code, exit_done) << made.err;
  EXPECT_THAT(made.out, HasSubstr("page.html"));
  const Json data = data_of(folder() / "pages/page.html");
  EXPECT_EQ(data["run"], "run");
  EXPECT_EQ(data["iterations"], 14);
  EXPECT_EQ(data["views"].size(), 2U);
  EXPECT_EQ(data["pictures"].size(), 2U);
  EXPECT_EQ(data["pictures"][0]["width"], 40);
  EXPECT_GT(data["mean"]["psnr"], 5);
  EXPECT_GT(data["train_seconds"], 0);
  EXPECT_FALSE(data["machine"]["processor"].get<std::string>().empty());
  const auto setting = [&](const std::string& of) {
    for (const Json& s : data["settings"]) {
      if (s["path"] == of) return s;
    }
    return Json();
  };
  EXPECT_EQ(setting("deform.network.width")["value"], "16");
  EXPECT_NE(setting("deform.network.width")["default"], "16");
  EXPECT_EQ(setting("iterations")["value"], "14");

  int64_t last = 0;
  for (const Json& phase : data["phases"]) {
    EXPECT_EQ(phase["first"], last + 1);
    last = phase["last"];
    EXPECT_GT(phase["steps"].size(), 5U);
  }
  EXPECT_EQ(last, 14);
  int starts = 0, ends = 0;
  for (const Json& event : data["events"]) {
    starts += event["event"] == "started" ? 1 : 0;
    ends += event["event"] == "finished" ? 1 : 0;
    if (event["event"] == "started") {
      EXPECT_EQ(event["machine"], data["machine"]);
    } else if (event["event"] == "step") {
      EXPECT_GT(event["memory_bytes"], 1 << 20);
    }
  }
  EXPECT_EQ(starts, 2);
  EXPECT_EQ(ends, 1);
}

TEST_F(See, EvalLeavesTheSamePage) {
  ASSERT_EQ(run_with({"eval", path("run"), "--layers", "none"}).code, exit_done);
  ASSERT_EQ(run_with({"report", path("run")}).code, exit_done);
  Json eval = data_of(folder() / "run/eval/test/report.html"), report = data_of(folder() / "run/report.html");
  for (Json* page : {&eval, &report}) {
    page->erase("made");
    page->erase("render_fps");
  }
  EXPECT_EQ(eval, report);
}

// Held-out views of a run that refined its cameras are measured with aligned ones too; training views have
// the refined ones.
TEST_F(See, RefinedCamerasAreThoseOfTheTrainingViews) {
  ASSERT_EQ(run_with({"train", "-d", path("capture"), "-o", path("refined"), "--preset", "demo", "--set",
                      "rates.camera=1e-3", "--specular", "none", "-q", "-i", "30"})
                .code,
            exit_done);
  const TrainedRun run = read_run(path("refined"));
  ASSERT_FALSE(run.cameras.empty());
  std::string warning;
  const Capture given = load_capture(run.capture_folder, run.options.capture),
                refined = capture_of(run, "", 0, warning);
  EXPECT_EQ(warning, "");
  ASSERT_EQ(refined.train.size(), given.train.size());
  float largest = 0;
  for (size_t i = 0; i < given.train.size(); ++i) {
    const Camera<float>& camera = refined.train[i].camera;
    EXPECT_EQ(camera.position, run.cameras.applied(given.train[i].camera, static_cast<int64_t>(i)).position);
    largest = std::max(largest, length(camera.position - given.train[i].camera.position));
  }
  EXPECT_GT(largest, 0);
  for (size_t i = 0; i < given.test.size(); ++i)
    EXPECT_EQ(refined.test[i].camera.position, given.test[i].camera.position);

  const Outcome eval = run_with({"eval", path("refined"), "--layers", "none"});
  ASSERT_EQ(eval.code, exit_done) << eval.err;
  EXPECT_THAT(eval.out, HasSubstr("\naligned "));
  const Json data = data_of(folder() / "refined/eval/test/report.html");
  EXPECT_GT(data["mean_aligned"]["psnr"], data["mean"]["psnr"].get<double>() - 0.05);
  EXPECT_NE(data["mean_aligned"]["psnr"], data["mean"]["psnr"]);
  ASSERT_EQ(run_with({"eval", path("refined"), "--split", "train", "--layers", "none"}).code, exit_done);
  EXPECT_FALSE(data_of(folder() / "refined/eval/train/report.html").contains("mean_aligned"));
}

TEST_F(See, RunsHavePathsOfWhatMoves) {
  const std::vector<std::string> render = {"render",     path("run"),           "--layers",
                                           "rgb,tracks", "--tracks-least-move", "0"};
  const auto with = [](std::vector<std::string> words, const std::vector<std::string>& more) {
    words.insert(words.end(), more.begin(), more.end());
    return run_with(words);
  };
  const Outcome made = with(render, {"-o", path("paths")});
  ASSERT_EQ(made.code, exit_done) << made.err;
  bool differs = false;
  for (const std::string& name : names_in(folder() / "paths/rgb")) {
    const Tensor<uint8_t> rgb = read_png(folder() / "paths/rgb" / name);
    const Tensor<uint8_t> tracks = read_png(folder() / "paths/tracks" / name);
    ASSERT_EQ(rgb.shape(), tracks.shape());
    differs = differs || !std::equal(rgb.values().begin(), rgb.values().end(), tracks.values().begin());
  }
  EXPECT_TRUE(differs);
  ASSERT_EQ(run_with({"eval", path("run"), "--layers", "tracks"}).code, exit_done);
  EXPECT_EQ(names_in(folder() / "run/eval/test/tracks"), names_in(folder() / "paths/tracks"));

  // Cameras of one's own need no capture, and the paths do not either.
  std::ofstream(folder() / "one.json")
      << R"([{"width": 20, "height": 12, "position": [0, 0, -2], "fx": 20, "fy": 20,
                                               "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "time": 0.5}])";
  fs::rename(folder() / "capture", folder() / "moved");
  const Outcome alone = with(render, {"-o", path("alone"), "--cameras", path("one.json")});
  fs::rename(folder() / "moved", folder() / "capture");
  EXPECT_EQ(alone.code, exit_done) << alone.err;
  EXPECT_EQ(names_in(folder() / "alone/tracks").size(), 1U);
}

// What training refuses today, an old run may have been trained with: its scene is shown all the same.
TEST_F(See, ARunOfOlderOptionsIsShown) {
  fs::copy(folder() / "run", folder() / "older", fs::copy_options::recursive);
  const fs::path checkpoint = folder() / "older/checkpoint.safetensors";
  Safetensors file = Safetensors::read(checkpoint);
  Json options = Json::parse(file.metadata["options"]);
  options["render"]["transmittance_min"] = 0;
  options["density"]["prune_above"] = 0;
  options["density"].erase("prune_above_from");
  file.metadata["options"] = options.dump();
  file.write(checkpoint);
  const Outcome made = run_with({"report", path("older")});
  ASSERT_EQ(made.code, exit_done) << made.err;
  const Json report = data_of(folder() / "older/report.html");
  const Json& settings = report["settings"];
  const auto pruned_from = std::find_if(settings.begin(), settings.end(), [](const Json& setting) {
    return setting["path"] == "density.prune_above_from";
  });
  ASSERT_NE(pruned_from, settings.end());
  EXPECT_EQ((*pruned_from)["value"], "0");
}

// Times are shares of the views that there are, and a split deals them out.
TEST_F(See, FiguresOfACaptureThatHasChangedSayThatItHas) {
  const auto metrics = [] { return Json::parse(bytes_of(folder() / "run/eval/test/metrics.json")); };
  const std::vector<std::string> eval = {"eval", path("run"), "--layers", "none", "-d"};
  const auto eval_on = [&](const std::string& capture) {
    std::vector<std::string> words = eval;
    words.push_back(capture);
    const Outcome made = run_with(words);
    EXPECT_EQ(made.code, exit_done) << made.err;
    return made.err;
  };
  EXPECT_THAT(eval_on(path("capture")), testing::Not(HasSubstr("times may have moved")));
  EXPECT_EQ(metrics()["views_as_trained"], true);
  fs::copy(folder() / "capture", folder() / "changed", fs::copy_options::recursive);
  Json dataset = Json::parse(bytes_of(folder() / "changed/dataset.json"));
  dataset["train_ids"].erase(1);
  std::ofstream(folder() / "changed/dataset.json") << dataset;
  EXPECT_THAT(eval_on(path("changed")), HasSubstr("times may have moved"));
  EXPECT_EQ(metrics()["views_as_trained"], false);
}

TEST_F(See, AReportOfARunWithoutALogHasNoEvents) {
  fs::copy(folder() / "run", folder() / "silent", fs::copy_options::recursive);
  fs::remove(folder() / "silent/log.jsonl");
  ASSERT_EQ(run_with({"report", path("silent")}).code, exit_done);
  EXPECT_TRUE(data_of(folder() / "silent/report.html")["events"].empty());
}

TEST_F(See, CompareStandsBesideThePhotograph) {
  ASSERT_EQ(run_with({"render", path("run"), "--compare", "-o", path("compared")}).code, exit_done);
  const std::set<std::string> names = names_in(folder() / "compared/compare");
  ASSERT_EQ(names.size(), 2U);
  EXPECT_EQ(names, names_in(folder() / "compared/rgb"));
  const Tensor<uint8_t> both = read_png(folder() / "compared/compare" / *names.begin()),
                        render = read_png(folder() / "compared/rgb" / *names.begin());
  ASSERT_EQ(both.shape(), (Shape{24, 80, 3}));
  for (int64_t y = 0; y < 24; ++y) {
    for (int64_t x = 0; x < 40; ++x) ASSERT_EQ(both(y, x + 40, 1), render(y, x, 1));
  }
}

TEST_F(See, AFrozenCameraSeesEveryTimeOnce) {
  for (const std::string& which : {std::string("1"), std::string("000003_right")}) {
    ASSERT_EQ(run_with({"render", path("run"), "--freeze-camera", which, "--compare", "-o",
                        path("frozen_" + which)})
                  .code,
              exit_done);
    EXPECT_EQ(names_in(folder() / ("frozen_" + which) / "compare").size(), 5U);
  }
  // The same camera by either name, and the photograph of the fourth time is its own.
  const auto picture = [](const std::string& name) { return bytes_of(folder() / name); };
  EXPECT_EQ(picture("frozen_1/compare/00003.png"), picture("frozen_000003_right/compare/00003.png"));
  ASSERT_EQ(run_with({"render", path("run"), "--compare", "-o", path("own")}).code, exit_done);
  EXPECT_EQ(picture("frozen_1/compare/00003.png"), picture("own/compare/000003_right.png"));

  ASSERT_EQ(run_with({"render", path("run"), "--freeze-camera", "0", "--frames", "3", "--size", "20x12", "-o",
                      path("three")})
                .code,
            exit_done);
  EXPECT_EQ(names_in(folder() / "three/rgb").size(), 3U);
  EXPECT_EQ(read_png(folder() / "three/rgb/00000.png").shape(), (Shape{12, 20, 3}));
}

TEST_F(See, PathsOfEveryKind) {
  std::ofstream(folder() / "path.json")
      << R"({"format":"traceflow camera path","version":1,"width":32,"height":18,
    "fps":4,"closed":true,"keyframes":[
    {"position":[0,0,-1],"rotation":[[1,0,0],[0,1,0],[0,0,1]],"fov_y":45,"time":0,"seconds":1},
    {"position":[1,0,-1],"rotation":[[1,0,0],[0,1,0],[0,0,1]],"fov_y":45,"time":1,"seconds":0.5}]})";
  const auto frames = [](std::vector<std::string> flags) {
    fs::remove_all(folder() / "path");
    flags.insert(flags.begin(), {"render", path("run"), "-o", path("path")});
    const Outcome made = run_with(flags);
    EXPECT_EQ(made.code, exit_done) << made.err;
    return names_in(folder() / "path/rgb").size();
  };
  const auto shape = [] { return read_png(folder() / "path/rgb/00000.png").shape(); };
  EXPECT_EQ(frames({"--camera-path", path("path.json")}), 6U);
  EXPECT_EQ(shape(), (Shape{18, 32, 3}));
  EXPECT_EQ(
      frames({"--camera-path", path("path.json"), "--fps", "8", "--size", "16x9", "--freeze-time", "0.5"}),
      12U);
  EXPECT_EQ(shape(), (Shape{9, 16, 3}));
  EXPECT_EQ(frames({"--spiral", "--frames", "4"}), 4U);
  EXPECT_EQ(shape(), (Shape{24, 40, 3}));
  EXPECT_EQ(frames({"--orbit", "--frames", "2", "--size", "30x20"}), 2U);
  EXPECT_EQ(shape(), (Shape{20, 30, 3}));
}

TEST_F(See, ARunThatWasExportedIntoItsFolderIsStillARun) {
  fs::copy(folder() / "run", folder() / "exported", fs::copy_options::recursive);
  ASSERT_EQ(run_with({"export", path("exported"), "-o", path("exported")}).code, exit_done);
  ASSERT_TRUE(fs::exists(folder() / "exported/main.ply"));
  EXPECT_TRUE(load_scene(folder() / "exported", "").run);
  EXPECT_FALSE(load_scene(folder() / "exported/main.ply", "").run);
  EXPECT_FALSE(load_scene(folder() / "exported", path("exported/main.ply")).run) << "a .ply reflects another";
  // A .ply alone would not know of the capture.
  const Outcome made = run_with({"render", path("exported"), "-o", path("of_exported")});
  ASSERT_EQ(made.code, exit_done) << made.err;
  EXPECT_EQ(names_in(folder() / "of_exported/rgb").size(), 2U);
  fs::remove(folder() / "exported/checkpoint.safetensors");
  fs::remove(folder() / "exported/checkpoint.previous.safetensors");
  EXPECT_FALSE(load_scene(folder() / "exported", "").run);
}

TEST_F(See, FlagsThatContradictEachOtherAreRefusedInWords) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"--orbit", "--spiral"}, "--orbit and --spiral"},
      {{"--split", "test", "--orbit"}, "--split and --orbit"},
      {{"--cameras", "a", "--camera-path", "b"}, "--cameras and --camera-path"},
      {{"--freeze-camera", "0", "--spiral"}, "--spiral and --freeze-camera"},
      {{"--freeze-camera", "0", "--freeze-time", "0.5"}, "freeze-time"},
      {{"--freeze-camera", "none"}, "freeze-camera"},
      {{"--freeze-camera", "3"}, "0 to 1"},
      {{"--freeze-camera", "-1"}, "freeze-camera"},
      {{"--frames", "5"}, "frames"},
      {{"--size", "5x5"}, "size"},
      {{"--compare", "--orbit"}, "no photograph"},
      {{"--compare", "--camera-path", "b"}, "no photograph"},
      {{"--compare", "--time", "0.5"}, "compare"},
      {{"--compare", "--freeze-camera", "0", "--frames", "5"}, "--frames"},
      {{"--compare", "--freeze-camera", "0", "--size", "5x5"}, "--size"},
      {{"--camera-path", path("nothing.json")}, "nothing.json"},
  };
  for (auto [words, part] : cases) {
    words.insert(words.begin(), {"render", path("run"), "-o", path("refused")});
    const Outcome refused = run_with(words);
    EXPECT_EQ(refused.code, exit_input) << part;
    EXPECT_THAT(refused.err, HasSubstr(part));
    EXPECT_EQ(std::count(refused.err.begin(), refused.err.end(), '\n'), 1) << refused.err;
  }
  EXPECT_FALSE(fs::exists(folder() / "refused"));
  const Outcome directory = run_with({"report", path("run"), "-o", path("run")});
  EXPECT_EQ(directory.code, exit_input);
  EXPECT_THAT(directory.err, HasSubstr("a folder"));
}

TEST_F(See, CtrlCEndsTheWorkAndSaysWhatThereIs) {
  std::signal(SIGINT, SIG_DFL);  // a shell that runs tests behind it has it ignored
  std::thread other([] {
    while (!fs::exists(folder() / "stopped/rgb/00001.png")) std::this_thread::yield();
    std::raise(SIGINT);
  });
  const Outcome stopped = run_with(
      {"render", path("run"), "--orbit", "--frames", "20000", "--size", "8x8", "-o", path("stopped")});
  other.join();
  EXPECT_EQ(stopped.code, exit_interrupted);
  EXPECT_THAT(stopped.err, HasSubstr("stopped after "));
  EXPECT_THAT(stopped.err, HasSubstr(" of 20000 frames: " + path("stopped")));
}

TEST_F(See, AFilmIsMadeWhereFfmpegIs) {
  const Outcome made =
      run_with({"render", path("run"), "--spiral", "--frames", "3", "--video", path("films/a.mp4")});
  if (made.code == exit_input) {
    EXPECT_THAT(made.err, HasSubstr("ffmpeg"));
    GTEST_SKIP() << made.err;
  }
  ASSERT_EQ(made.code, exit_done) << made.err;
  EXPECT_THAT(bytes_of(folder() / "films/a.mp4").substr(0, 12), HasSubstr("ftyp"));
}

TEST(CountProgress, TellsRateAndWhatIsLeft) {
  EXPECT_EQ(count_line({"", "frames", 0, 10}, 0), "0/10 frames");
  EXPECT_EQ(count_line({"", "frames", 5, 125}, 2), "5/125 frames  2.5 a second  48 s left");
  EXPECT_EQ(count_line({"features", "", 5, 125}, 2), "features  5/125  2.5 a second  48 s left");
  EXPECT_EQ(count_line({"frames", "", 30, 0}, 2), "frames    30  15 a second");
  EXPECT_EQ(count_line({"poses", "", 0, 0}, 2), "poses     …");
}

TEST(CountProgress, RedrawsOneLineOnATerminalAndWritesFewElsewhere) {
  std::ostringstream terminal, file;
  CountProgress on_terminal(terminal, 20), elsewhere(file, 0);
  for (int i = 1; i <= 1000; ++i) {
    on_terminal.show({"", "frames", i, 1000}, 0.05 * i);
    elsewhere.show({"", "frames", i, 1000}, 0.05 * i);
  }
  on_terminal.finish();
  elsewhere.finish();
  EXPECT_EQ(terminal.str().find('\n'), std::string::npos);
  EXPECT_TRUE(terminal.str().ends_with("\r\x1b[K"));
  const std::string lines = file.str();
  EXPECT_EQ(std::count(lines.begin(), lines.end(), '\n'), 3);
}

}  // namespace
}  // namespace traceflow::cli
