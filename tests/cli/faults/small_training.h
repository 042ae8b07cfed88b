#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/faults/world.h"
#include "scene/run_folder.h"
#include "support/file_bytes.h"
#include "support/temp_folder.h"

// A training of a second or two, for worlds in which something goes wrong.
namespace traceflow::faults {

namespace fs = std::filesystem;

// How often the long version of a test is to try.
inline int number_from_environment(const char* name, int usual) {
  const char* const wanted = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): there is one thread
  return wanted == nullptr ? usual : std::atoi(wanted);
}

inline int lines(const std::string& text) {
  return static_cast<int>(std::count(text.begin(), text.end(), '\n'));
}

// Of what lies in a folder, sorted.
inline std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

// A run's state in bytes, without how long it took.
inline std::string state_of(const fs::path& run) {
  std::string note;
  Safetensors file = read_checkpoint(RunFolder{run}, note);
  EXPECT_EQ(note, "");
  file.metadata["train_seconds"] = "0";
  const TempFolder folder;
  file.write(folder / "state");
  return bytes_of(folder / "state");
}

class Faults : public testing::Test {
 protected:
  static constexpr int iterations = 24;

  static void SetUpTestSuite() {
    if (shared_folder != nullptr) return;
    static const TempFolder folder;
    shared_folder = &folder;
    fs::permissions(folder.path(), fs::perms::all);
    ASSERT_EQ(run({"synth", path("capture"), "--frames", "5", "--width", "40", "--height", "24", "--samples",
                   "2", "--points", "200", "--test-every", "2"})
                  .code,
              0);
    const Outcome whole = run(training("whole"));
    ASSERT_EQ(whole.code, 0) << whole.error;
  }

  static std::string path(const std::string& name) { return (*shared_folder / name).string(); }
  static RunFolder run_in(const std::string& name) { return RunFolder{*shared_folder / name}; }
  static std::vector<std::string> training(const std::string& name,
                                           const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{"train",
                                   "-d",
                                   path("capture"),
                                   "-o",
                                   path(name),
                                   "--preset",
                                   "demo",
                                   "--set",
                                   "deform.network.width=16",
                                   "--set",
                                   "deform.environment_network.width=16",
                                   "--set",
                                   "initial.environment_cells=4",
                                   "--set",
                                   "save_every=3",
                                   "--device",
                                   "cpu",
                                   "--threads",
                                   "2",
                                   "-q"};
    if (std::find(more.begin(), more.end(), "-i") == more.end())
      words.insert(words.end(), {"-i", std::to_string(iterations)});
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  static std::vector<std::string> resuming(const std::string& name) {
    return {"train", "-o", path(name), "--resume", "-q", "--device", "cpu"};
  }
  // That a run would go on from.
  static double iteration_saved(const std::string& name) {
    std::string note;
    return read_checkpoint(run_in(name), note).number("iteration");
  }
  // The lines of a run's log, each of which is JSON.
  static std::vector<nlohmann::json> logged(const std::string& name) {
    std::vector<nlohmann::json> result;
    std::ifstream log(run_in(name).log());
    for (std::string line; std::getline(log, line);) {
      EXPECT_TRUE(nlohmann::json::accept(line)) << line;
      result.push_back(nlohmann::json::parse(line, nullptr, false));
    }
    return result;
  }
  // Of a run that nothing went wrong with.
  static std::string whole_state() { return state_of(path("whole")); }

  // That a program ended in one line.
  static void expect_one_line(const Outcome& outcome, int code) {
    EXPECT_EQ(outcome.code, code) << outcome.error;
    EXPECT_EQ(lines(outcome.error), 1) << outcome.error;
    EXPECT_TRUE(outcome.error.starts_with("traceflow: ")) << outcome.error;
    EXPECT_EQ(outcome.output, "");
  }
  static std::vector<std::string> files_in(const std::string& name) { return names_in(path(name)); }
  // That a run, whatever it went through, came to its end and left nothing beside its own files.
  static void expect_completed(const std::string& name) {
    EXPECT_EQ(logged(name).back()["ending"], "completed");
    EXPECT_EQ(files_in(name), (std::vector<std::string>{"checkpoint.previous.safetensors",
                                                        "checkpoint.safetensors", "log.jsonl"}));
  }
  // That it did so in the bytes of the run that nothing went wrong with.
  static void expect_whole(const std::string& name) {
    expect_completed(name);
    EXPECT_TRUE(state_of(path(name)) == whole_state());
    if (!fs::exists(path("whole_ply"))) export_run("whole", "whole_ply");
    export_run(name, "ply");
    for (const char* set : {"main.ply", "environment.ply"}) {
      const std::string bytes = bytes_of(*shared_folder / "ply" / set);
      EXPECT_FALSE(bytes.empty());
      EXPECT_TRUE(bytes == bytes_of(*shared_folder / "whole_ply" / set)) << set;
    }
  }

 private:
  static void export_run(const std::string& name, const std::string& to) {
    const Outcome end = run({"export", path(name), "-o", path(to)});
    EXPECT_EQ(end.code, 0) << end.error;
  }

  static inline const TempFolder* shared_folder = nullptr;
};

}  // namespace traceflow::faults
