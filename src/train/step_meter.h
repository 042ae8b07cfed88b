#pragma once

#include <optional>

#include "base/device.h"
#include "record/events.h"

namespace traceflow {

// Measures where the time of iterations goes, by the steps of base/profile.h, beside whoever else profiles:
// what was on stays on, and the profile's table is not cleared. On the CPU every iteration is measured; on
// CUDA one in a hundred, unless profiling is on already.
class StepMeter {
 public:
  explicit StepMeter(Device device) : device_(device) {}

  // Stands while the iteration works.
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

  // What was measured since the last call; nothing where no iteration was.
  std::optional<events::Measured> take(int64_t iteration, const std::string& phase);

 private:
  // Of the time between two looks at the profile's table.
  void add(const std::vector<profile::Entry>& before, const std::vector<profile::Entry>& after);

  Device device_;
  int64_t iterations_ = 0;
  std::vector<profile::Entry> steps_;
};

}  // namespace traceflow
