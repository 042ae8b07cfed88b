#include "cli/terminal/stop_request.h"

#include <csignal>

namespace traceflow::cli {

namespace {

std::atomic<bool> stop_requested{false};

void request_stop(int signal_number) {
  stop_requested = true;
  std::signal(signal_number, SIG_DFL);
}

}  // namespace

const std::atomic<bool>& stop_on_signals() {
  stop_requested = false;
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
  // nohup has asked for it to be ignored.
  if (std::signal(SIGHUP, request_stop) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  return stop_requested;
}

}  // namespace traceflow::cli
