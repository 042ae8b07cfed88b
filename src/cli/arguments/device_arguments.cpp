#include "cli/arguments/device_arguments.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <iostream>

#include "base/device_memory.h"
#include "base/error.h"
#include "base/parallel.h"
#include "primitives/gemm.h"

namespace traceflow::cli {

std::string cuda_text() {
  std::string why_not;
  if (!cuda::is_ready(why_not)) return "none: " + why_not;
  const cuda::DeviceFacts facts = cuda::facts();
  return fmt::format("{} ({}.{}), {} of {} MiB free", facts.name, facts.major, facts.minor,
                     facts.free_bytes >> 20, facts.total_bytes >> 20);
}

struct DeviceArguments::State {
  std::string device = "auto";
  bool deterministic = false;
};

DeviceArguments::DeviceArguments(CLI::App& verb) : state_(std::make_shared<State>()) {
  verb.add_option("--device", state_->device, "auto (CUDA if a device is available), cpu or cuda")
      ->check(CLI::IsMember({"auto", "cpu", "cuda"}))
      ->option_text("DEVICE")
      ->capture_default_str();
  verb.add_flag("--deterministic", state_->deterministic,
                "On CUDA: sum in a fixed order, so that every run gives the same bytes; somewhat slower. The "
                "CPU always does this");
}

Device DeviceArguments::choose(bool quiet) const {
  cuda::set_deterministic(state_->deterministic);
  const std::string& asked = state_->device;
  std::string why_not = "asked for with --device cpu";
  const bool cuda = asked != "cpu" && cuda::is_ready(why_not);
  if (asked == "cuda" && !cuda) {
    throw InputError("--device", "", "cuda, but " + why_not, "a CUDA device", "use --device cpu");
  }
  if (!quiet) {
    const std::string reason = asked == "auto" ? "it answers" : "asked for with --device cuda";
    std::cerr << (cuda ? fmt::format("device: cuda, {}; {}", cuda_text(), reason)
                       : fmt::format("device: cpu, {} thread{}; {}", thread_count(),
                                     thread_count() == 1 ? "" : "s",
                                     asked == "auto" ? "no CUDA: " + why_not : why_not))
              << std::endl;
  }
  return cuda ? Device::cuda : Device::cpu;
}

}  // namespace traceflow::cli
