#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <iostream>
#include <string_view>
#include <thread>

#include "base/random.h"
#include "cli/faults/small_training.h"

// `kill -9` at any moment. A few kills here; scripts/kill_test makes as many as it is told.
namespace traceflow::faults {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

int kills_wanted() { return number_from_environment("TRACEFLOW_KILLS", 4); }

bool is_half_written(const RunFolder& run) {
  return fs::exists(run.folder / "checkpoint.new.safetensors.partial") ||
         fs::exists(run.folder / "checkpoint.new.safetensors");
}

// Hears of every checkpoint's first byte, whatever the name that it is written under.
class Ear {
 public:
  explicit Ear(const fs::path& folder) : descriptor_(::inotify_init1(IN_NONBLOCK | IN_CLOEXEC)) {
    ::inotify_add_watch(descriptor_, folder.c_str(), IN_CREATE | IN_MODIFY);
  }
  ~Ear() { ::close(descriptor_); }
  Ear(const Ear&) = delete;
  Ear& operator=(const Ear&) = delete;

  bool hears_a_checkpoint() {
    alignas(inotify_event) std::array<char, 4096> told{};
    const ssize_t size = ::read(descriptor_, told.data(), told.size());
    return size > 0 && std::string_view(told.data(), static_cast<size_t>(size)).find("checkpoint") !=
                           std::string_view::npos;
  }

 private:
  int descriptor_;
};

struct Account {
  int kills = 0, while_writing = 0, before_the_first = 0, runs = 0;
};

class Kill : public Faults {
 protected:
  // Half of the time at a random moment, else just when a checkpoint is being written. Whether it was killed
  // before it ended.
  bool kill_somewhere(Process& training, Ear& ear, double usual_seconds) {
    const bool while_writing = random_.below(2) == 0;
    const Seconds wait(random_.uniform() * usual_seconds), more(random_.uniform() * 4e-4);
    const Clock::time_point start = Clock::now();
    while (!training.has_ended() &&
           (while_writing ? !ear.hears_a_checkpoint() : Clock::now() - start < wait)) {
      std::this_thread::sleep_for(std::chrono::microseconds(while_writing ? 5 : 500));
    }
    if (while_writing) std::this_thread::sleep_for(more);
    if (training.has_ended()) return false;
    training.send(SIGKILL);
    return training.wait().code == -SIGKILL;
  }

  // A checkpoint that can be read stands, no older than the one before, or none was ever written. It is the
  // current one, which keeps its name until a whole one takes it: a kill damages none.
  void check_what_stands() {
    if (!run_.holds_a_run()) {
      EXPECT_EQ(reached_, 0);
      ++account_.before_the_first;
      return;
    }
    std::string note;
    const double now = read_checkpoint(run_, note).number("iteration");
    EXPECT_EQ(note, "");
    EXPECT_GE(now, reached_);
    reached_ = now;
  }

  void check_the_end() {
    expect_whole("killed");
    fs::remove_all(run_.folder);
    reached_ = 0;
    ++account_.runs;
  }

  RunFolder run_ = run_in("killed");
  Random random_{20261122};
  double reached_ = 0;  // iterations
  Account account_;
};

TEST_F(Kill, ALoadableCheckpointStandsAndTheResumedRunEndsInTheSameBytes) {
  const int wanted = kills_wanted();
  const Clock::time_point start = Clock::now();
  ASSERT_EQ(run(training("timed")).code, 0);
  const double usual = Seconds(Clock::now() - start).count();

  for (bool over = false; !over;) {
    over = account_.kills >= wanted;
    fs::create_directories(run_.folder);
    Ear ear(run_.folder);
    Process training(run_.holds_a_run() ? resuming("killed") : this->training("killed"), {});
    if (!over && kill_somewhere(training, ear, usual)) {
      ++account_.kills;
      account_.while_writing += is_half_written(run_) ? 1 : 0;
      check_what_stands();
    } else {
      const Outcome end = training.wait();
      ASSERT_EQ(end.code, 0) << end.error;
      check_the_end();
    }
    if (HasFailure()) return;
  }
  std::cout << account_.kills << " kills in " << Seconds(Clock::now() - start).count()
            << " s: " << account_.while_writing << " while a checkpoint was being written, "
            << account_.before_the_first << " before the first; " << account_.runs
            << " runs came to their end in the same bytes\n";
}

}  // namespace
}  // namespace traceflow::faults
