#include "cli/terminal/stop_request.h"

#include <array>
#include <csignal>
#include <cstdint>
#include <ctime>

namespace traceflow::cli {

namespace {

constexpr int64_t second = 1'000'000'000;  // nanoseconds

std::atomic<bool> stop_requested{false};
// When each signal first came, in nanoseconds; 0: not yet.
std::array<std::atomic<int64_t>, NSIG> first_came{};

// These two only call functions that are safe in signal handlers.
int64_t nanoseconds_now() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * second + now.tv_nsec;
}

void request_stop(int signal_number) {
  stop_requested = true;
  const int64_t now = nanoseconds_now();
  int64_t first = 0;
  if (first_came[static_cast<size_t>(signal_number)].compare_exchange_strong(first, now)) return;
  if (signal_number == SIGHUP || now - first < second) return;
  std::signal(signal_number, SIG_DFL);
  std::raise(signal_number);
}

void listen_to(int signal_number) {
  first_came[static_cast<size_t>(signal_number)] = 0;
  struct sigaction action {};
  action.sa_handler = request_stop;
  action.sa_flags = SA_RESTART;
  ::sigaction(signal_number, &action, nullptr);
}

bool is_ignored(int signal_number) {
  struct sigaction action {};
  return ::sigaction(signal_number, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

}  // namespace

const std::atomic<bool>& stop_on_signals() {
  stop_requested = false;
  listen_to(SIGTERM);
  // If they are ignored, nohup or a script that started this program with `&` requested it.
  for (const int signal_number : {SIGINT, SIGHUP}) {
    if (!is_ignored(signal_number)) listen_to(signal_number);
  }
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  return stop_requested;
}

}  // namespace traceflow::cli
