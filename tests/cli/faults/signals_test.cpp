#include <gtest/gtest.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/process.h"
#include "cli/faults/small_training.h"

// Those who end a training seldom send one signal: `timeout` signals the program and then its group, a shell
// passes the hang-up on that the system sends as well. The two come within a millisecond.
namespace traceflow::faults {
namespace {

using namespace std::chrono_literals;

class Signals : public Faults {
 protected:
  // A shell that runs tests behind it may have had them ignored.
  void SetUp() override { before_ = std::signal(SIGINT, SIG_DFL); }
  void TearDown() override { std::signal(SIGINT, before_); }

  // Whether it came to pass, within a minute.
  template <class F>
  static bool comes(F&& event) {
    const auto begin = std::chrono::steady_clock::now();
    while (!event() && std::chrono::steady_clock::now() - begin < 60s) std::this_thread::sleep_for(1ms);
    return event();
  }
  // That the last thing it did was to save the iteration at which it ended.
  static void expect_saved(const RunFolder& run) {
    std::string note, last;
    std::ifstream log(run.log());
    for (std::string line; std::getline(log, line);) last = line;
    const auto end = nlohmann::json::parse(last);
    EXPECT_EQ(end["event"], "finished") << last;
    EXPECT_EQ(end.value("ending", ""), "interrupted") << last;
    EXPECT_EQ(read_checkpoint(run, note).number("iteration"), end["iteration"].get<double>()) << note;
  }

 private:
  void (*before_)(int) = nullptr;
};

TEST_F(Signals, OneThatComesMoreThanOnceEndsTheTrainingInASavedState) {
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    const std::string name = "signal_" + std::to_string(number);
    fs::remove_all(path(name));
    Process training(this->training(name, {"-i", "100000"}), {});
    ASSERT_TRUE(comes([&] { return run_in(name).holds_a_run(); }));
    // Several: those that come before the first is looked at are one.
    for (int i = 0; i < 10; ++i) {
      training.send(number);
      std::this_thread::sleep_for(200us);
    }
    EXPECT_EQ(training.wait().code, 130) << number;
    expect_saved(run_in(name));
  }
}

// A line for a shell that runs a training.
std::string command_line(const std::vector<std::string>& words) {
  std::string line = fs::read_symlink("/proc/self/exe").string() + " traceflow";
  for (const std::string& word : words) line += " '" + word + "'";
  return line + "\n";
}

// An interactive shell on a terminal of its own, as ssh gives one.
class Terminal {
 public:
  Terminal() : shell_(::forkpty(&terminal_, nullptr, nullptr, nullptr)) {
    if (shell_ != 0) return;
    std::signal(SIGHUP, SIG_DFL);
    ::execlp("bash", "bash", "--norc", "--noprofile", "--noediting", "-i", nullptr);
    ::_exit(99);
  }
  ~Terminal() {
    hang_up();
    ::waitpid(shell_, nullptr, 0);
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  void type(const std::string& text) const {
    for (size_t done = 0; done < text.size();) {
      const ssize_t n = ::write(terminal_, text.data() + done, text.size() - done);
      ASSERT_GT(n, 0);
      done += static_cast<size_t>(n);
    }
  }
  void hang_up() {
    if (terminal_ >= 0) ::close(terminal_);
    terminal_ = -1;
  }

 private:
  int terminal_ = -1;
  pid_t shell_;
};

TEST_F(Signals, AConnectionThatBreaksEndsTheTrainingInASavedState) {
  if (!is_in_path("bash")) GTEST_SKIP() << "no bash";
  const RunFolder run = run_in("disconnected");
  fs::remove_all(run.folder);
  Terminal terminal;
  terminal.type(command_line(training("disconnected", {"-i", "100000"})));
  ASSERT_TRUE(comes([&] { return run.holds_a_run(); }));
  terminal.hang_up();
  // The lock goes when a training ends in good order, and stays when it is killed.
  EXPECT_TRUE(comes([&] { return !fs::exists(run.lock()); }));
  expect_saved(run);
}

}  // namespace
}  // namespace traceflow::faults
