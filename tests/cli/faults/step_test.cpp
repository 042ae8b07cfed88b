#include <gtest/gtest.h>

#include <iostream>
#include <optional>

#include "base/parallel.h"
#include "cli/faults/small_training.h"
#include "train/initialise.h"
#include "train/small_run.h"

// An iteration that is refused a request for memory, any of them, in this process: what was trained is as if
// it had not begun, or had come to its end.
namespace traceflow::faults {
namespace {

class RefusedStep : public testing::Test {
 protected:
  // On one thread the requests come in the same order every time.
  void SetUp() override { set_threads(1); }
  void TearDown() override { set_threads(0); }

  static TrainOptions options() {
    TrainOptions options = small_run(40);
    options.density.max_surfels = 1000;
    options.rates.camera = 1e-4F;
    return options;
  }
  // Goes on with the run from where it stands to after this iteration, whose last one is refused its n-th
  // request; 0: none.
  static events::Finished go_on(const fs::path& run, int iteration, int64_t n = 0) {
    Trainer trainer(options(), load_capture(capture_folder(), options().capture), run);
    if (RunFolder{run}.holds_a_run()) trainer.resume();
    std::atomic<bool> stop{false};
    std::optional<RefusedOnce> refused;
    trainer.stream().listen([&](const events::Event& event) {
      if (std::holds_alternative<events::Started>(event) && n > 0) refused.emplace(n);
      const auto* step = std::get_if<events::Step>(&event);
      if (step == nullptr) return;
      refused.reset();
      stop = step->iteration == iteration;
    });
    events::Finished end = trainer.run(stop);
    EXPECT_EQ(end.iteration, trainer.iteration());
    // Only a driver that has no memory for a kernel can stop a change to the scene half-way.
    EXPECT_EQ(end.reason.find("in the middle of a change"), std::string::npos) << end.reason;
    return end;
  }
  bool is_refused(int iteration, int64_t n) {
    fs::remove_all(folder_ / "tried");
    fs::copy(folder_ / "before", folder_ / "tried");
    return go_on(folder_ / "tried", iteration, n).ending == events::Ending::out_of_memory;
  }
  // How many requests an iteration makes, about: some of those that are refused are done without.
  int64_t requests_of(int iteration) {
    const auto beyond = [&](int64_t n) {
      for (int64_t i = n; i < n + 4; ++i) {
        if (is_refused(iteration, i)) return false;
      }
      return true;
    };
    int64_t high = 64;
    while (!beyond(high)) high *= 2;
    int64_t low = high / 2;
    while (high - low > 1) (beyond((low + high) / 2) ? high : low) = (low + high) / 2;
    return high;
  }
  // The last of them, where all is put in its place, each `stride` of them, and a few of those before.
  template <class F>
  void for_requests(int iteration, int64_t ending, int64_t stride, F&& check) {
    go_on(folder_ / "before", iteration - 1);
    const int64_t all = requests_of(iteration), dense = all - ending;
    ASSERT_GT(dense, 0);
    int refused = 0;
    for (int64_t n = 1; n < all; n += n < dense ? dense / 16 : stride) {
      SCOPED_TRACE("request " + std::to_string(n) + " of " + std::to_string(all));
      if (!is_refused(iteration, n)) continue;
      ++refused;
      check(folder_ / "tried");
      if (HasFailure()) return;
    }
    EXPECT_GT(refused, 40);
    std::cout << refused << " refusals of " << all << " requests\n";
  }

  TempFolder folder_;
};

TEST_F(RefusedStep, IsDoneOnceWhenTheRunGoesOn) {
  constexpr int iteration = 19;  // in which everything trains and no set changes its size
  go_on(folder_ / "whole", iteration - 1);
  go_on(folder_ / "whole", iteration);
  const std::string whole = state_of(folder_ / "whole");
  for_requests(iteration, 300, 4, [&](const fs::path& run) {
    go_on(run, iteration);
    EXPECT_TRUE(state_of(run) == whole);
  });
}

// Density control that finds no room is left out, and what is left fits together.
TEST_F(RefusedStep, OfDensityControlLeavesARunThatGoesOn) {
  constexpr int iteration = 8;  // after which there are more surfels
  for_requests(iteration, 160, 1, [&](const fs::path& run) {
    EXPECT_NO_THROW(Trainer(options(), load_capture(capture_folder(), options().capture), run).resume());
  });
}

// There is no memory for the copies of bodies that an iteration begins with.
TEST_F(RefusedStep, ThatCannotCopyItsStateLeavesItAlone) {
  TrainOptions nodes = options();
  nodes.deform.kind = "nodes";
  const Capture capture = load_capture(capture_folder(), nodes.capture);
  Random random;
  TrainingState state(nodes, capture, initial_scene(capture, nodes, random).scene);
  ASSERT_TRUE(state.scene.main_motion);
  const std::string before = scene_bytes(state.scene);
  int refused = 0;
  for (int64_t n = 1;; ++n) {
    state.begin_iteration(false);
    try {
      const RefusedOnce once(n);
      state.begin_iteration(true);
      break;
    } catch (const std::bad_alloc&) {
      ++refused;
    }
    state.roll_back();
    ASSERT_EQ(scene_bytes(state.scene), before) << n;
  }
  EXPECT_GT(refused, 10);
}

}  // namespace
}  // namespace traceflow::faults
