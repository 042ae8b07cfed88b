#pragma once

#include <optional>

#include "base/device.h"
#include "record/events.h"

namespace traceflow {

// Measures where the time of iterations goes, by the steps of base/profile.h. Works beside other users of the
// profile: profiling that was on stays on, and the table is not cleared. On the CPU every iteration is
// measured, on CUDA one in a hundred, unless profiling is already on.
class StepMeter {
 public:
  explicit StepMeter(Device device) : device_(device) {}

  // Measures an iteration during its lifetime.
  class Iteration {
   public:
    Iteration(StepMeter& meter, int64_t iteration);
    ~Iteration();
    Iteration(const Iteration&) = delete;
    Iteration& operator=(const Iteration&) = delete;

   private:
    StepMeter* meter_;
    bool was_on_, measures_;
    std::vector<profile::Entry> before_;
  };

  // The measurements since the last call; nothing if no iteration was measured.
  std::optional<events::Measured> take(int64_t iteration, const std::string& phase);

 private:
  // Adds the time between two states of the profile's table.
  void add(const std::vector<profile::Entry>& before, const std::vector<profile::Entry>& after);

  Device device_;
  int64_t iterations_ = 0;
  std::vector<profile::Entry> steps_;
};

}  // namespace traceflow
