#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/wait.h>
#include <unistd.h>

#include <functional>
#include <iostream>
#include <set>
#include <utility>

#include "base/random.h"
#include "cli/faults/small_training.h"
#include "cli/terminal/error_boundary.h"
#include "files/options_json.h"
#include "files/png.h"
#include "ops/trace/trace_hits.h"
#include "scene/scene_file.h"
#include "support/temp_folder.h"
#include "train/options.h"

// The n-th request for memory is refused, for many n; or that one and all that follow.
namespace traceflow::faults {
namespace {

using testing::HasSubstr;

int trials_wanted() { return number_from_environment("TRACEFLOW_REFUSALS", 4); }

class Allocation : public Faults {
 protected:
  // Half of them among the first thousands, where every one is another place, the others anywhere.
  std::set<int64_t> moments(int64_t all) {
    std::set<int64_t> chosen;
    while (static_cast<int>(chosen.size()) < trials_wanted()) {
      const double spread = static_cast<double>(all);
      chosen.insert(1 + static_cast<int64_t>(random_.below(2) == 0 ? std::pow(spread, random_.uniform())
                                                                   : spread * random_.uniform()));
    }
    return chosen;
  }
  int64_t allocations_of(const std::vector<std::string>& words) {
    const Outcome counted = run(words, {.failing_allocation = count_only});
    EXPECT_EQ(counted.code, 0) << counted.error;
    return allocations_said(counted.error);
  }
  // After which iterations density control was done, and in which set: where it finds no room it is left out.
  static std::set<std::pair<int, std::string>> controlled(const std::string& name) {
    std::set<std::pair<int, std::string>> result;
    for (const nlohmann::json& event : logged(name)) {
      if (event["event"] == "density_changed")
        result.emplace(event["iteration"].get<int>(), event["set"].get<std::string>());
    }
    return result;
  }
  static void expect_nothing_half_written(const std::string& name) {
    if (!fs::exists(path(name))) return;
    for (const std::string& file : files_in(name)) EXPECT_FALSE(file.ends_with(".partial")) << file;
  }

  Random random_{7};
};

TEST_F(Allocation, ATrainingEndsInOneLineAndAStateThatGoesOn) {
  const int64_t all = allocations_of(training("counted"));
  ASSERT_GT(all, 10'000);
  int ended = 0, saved = 0, whole = 0;
  for (const bool from_there : {false, true}) {
    for (const int64_t n : moments(all)) {
      SCOPED_TRACE((from_there ? "from allocation " : "allocation ") + std::to_string(n));
      fs::remove_all(path("starved"));
      const Outcome end =
          run(training("starved"), {.failing_allocation = n, .failing_from_there = from_there});
      // What asks again with less, such as a sort for its buffer, goes on.
      if (end.code == 0) {
        EXPECT_TRUE(state_of(path("starved")) == whole_state());
        continue;
      }
      ++ended;
      expect_nothing_half_written("starved");
      expect_one_line(end, 4);
      EXPECT_THAT(end.error, HasSubstr("out of memory"));
      if (!run_in("starved").holds_a_run()) continue;
      ++saved;
      const Outcome resumed = run(resuming("starved"));
      EXPECT_EQ(resumed.code, 0) << resumed.error;
      expect_completed("starved");
      if (controlled("starved") == controlled("whole")) {
        expect_whole("starved");
        ++whole;
      }
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(saved, 0);
  EXPECT_GT(2 * whole, saved) << "few of an iteration's requests are density control's";
  std::cout << ended << " of " << 2 * trials_wanted() << " trainings ended, " << saved
            << " in a saved state, of which " << whole << " came to the same bytes; " << all
            << " allocations in all\n";
}

// Where a request is refused in a destructor of nlohmann-json's, the end is that of guard_termination().
TEST_F(Allocation, EveryRequestOfACheckpointThatIsRefusedEndsTheProgramInOneLine) {
  std::string note;
  const Safetensors read = read_checkpoint(run_in("whole"), note);
  const Scene scene = get_scene(read);
  ASSERT_TRUE(scene.environment_field.has_value());
  const auto state = [&] {
    Safetensors file;
    put_scene(scene, file);
    file.metadata["options"] = options_to_json(TrainOptions());
    file.write(path("state"));
    return 0;
  };
  const auto code_where_refused = [&](int64_t n) {
    const pid_t process = ::fork();
    if (process == 0) {
      std::cerr.rdbuf(nullptr);
      cli::guard_termination();
      const RefusedOnce once(n);
      ::_exit(cli::guarded(state, std::cerr));
    }
    int status = 0;
    ::waitpid(process, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  };
  int64_t n = 0;
  for (int code = 4; code != 0; code = code_where_refused(n)) {
    ASSERT_EQ(code, 4) << "allocation " << n;
    ++n;
  }
  EXPECT_GT(n, 500);
}

TEST_F(Allocation, VerbsThatReadARunEndInOneLine) {
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"export", path("whole"), "-o", path("starved_ply")},
        {"eval", path("whole"), "--device", "cpu"}}) {
    const int64_t all = allocations_of(words);
    for (const int64_t n : moments(all)) {
      SCOPED_TRACE(words[0] + ", allocation " + std::to_string(n));
      const Outcome end = run(words, {.failing_allocation = n});
      if (end.code == 0) continue;
      EXPECT_EQ(end.code, 4) << end.error;
      EXPECT_THAT(end.error, HasSubstr("out of memory"));
      if (HasFailure()) return;
    }
  }
}

// Every request that a PNG's reading or writing makes, libpng's own among them, refused once.
TEST(Refusal, APictureThatThereIsNoMemoryForIsNoBadPicture) {
  const TempFolder folder;
  Tensor<uint8_t> pixels({40, 50, 3});
  Random random(1);
  for (uint8_t& v : pixels.values()) v = static_cast<uint8_t>(random.below(256));
  write_png(folder / "a.png", pixels);
  for (const std::function<void()>& work :
       {std::function<void()>([&] { read_png(folder / "a.png"); }), {[&] { png_bytes(pixels); }}}) {
    int refused = 0;
    for (bool done = false; !done; ++refused) {
      const RefusedOnce once(refused + 1);
      try {
        work();
        done = true;
      } catch (const std::bad_alloc&) {
      }
    }
    EXPECT_GT(refused, 5);
  }
}

// What a thread keeps from ray to ray is used again after a ray for which there was no memory.
TEST(Refusal, HitsThatCannotGrowStayAsTheyWere) {
  trace::Hits hits;
  size_t pushed = 0;
  const auto push = [&] {
    hits.push(static_cast<float>(pushed), 0.5F, static_cast<uint32_t>(pushed));
    ++pushed;
  };
  push();
  bool refused = false;
  {
    const NoMemory none;
    try {
      while (pushed < 10'000) push();
    } catch (const std::bad_alloc&) {
      refused = true;
    }
  }
  EXPECT_TRUE(refused);
  EXPECT_EQ(hits.count, pushed);
  while (pushed < 10'000) push();
  for (size_t i = 0; i < pushed; ++i) EXPECT_EQ(hits.surfel[i], i);
}

}  // namespace
}  // namespace traceflow::faults
