#include "train/step_meter.h"

#include <algorithm>
#include <new>
#include <utility>

namespace traceflow {

namespace {

// Coprime to the intervals of the schedule, so that density control is measured as often as it happens.
constexpr int64_t stride_on_cuda = 101;
constexpr int64_t first_on_cuda = 10;

// The entry with this name. Looks at `place` first: the entry is there as long as the lists only grow at
// their end.
template <class Entries>
auto find(Entries& entries, const std::string& name, size_t place) {
  if (place < entries.size() && entries[place].name == name)
    return entries.begin() + static_cast<std::ptrdiff_t>(place);
  return std::find_if(entries.begin(), entries.end(),
                      [&](const profile::Entry& e) { return e.name == name; });
}

}  // namespace

StepMeter::Iteration::Iteration(StepMeter& meter, int64_t iteration)
    : meter_(&meter),
      was_on_(profile::is_on()),
      measures_(was_on_ || meter.device_ == Device::cpu || iteration % stride_on_cuda == first_on_cuda) {
  if (!measures_) return;
  before_ = profile::entries();
  profile::enable(true);
}

StepMeter::Iteration::~Iteration() {
  if (!measures_) return;
  profile::enable(was_on_);
  try {
    meter_->add(before_, profile::entries());
  } catch (const std::bad_alloc&) {
    // The iteration does not count as measured. It may itself end for lack of memory.
  }
}

void StepMeter::add(const std::vector<profile::Entry>& before, const std::vector<profile::Entry>& after) {
  ++iterations_;
  for (size_t i = 0; i < after.size(); ++i) {
    profile::Entry spent = after[i];
    if (const auto old = find(before, spent.name, i); old != before.end()) {
      spent.calls -= old->calls;
      spent.seconds -= old->seconds;
    }
    if (spent.calls <= 0) continue;
    const auto sum = find(steps_, spent.name, i);
    if (sum == steps_.end()) {
      steps_.push_back(std::move(spent));
    } else {
      sum->calls += spent.calls;
      sum->seconds += spent.seconds;
    }
  }
}

std::optional<events::Measured> StepMeter::take(int64_t iteration, const std::string& phase) {
  if (iterations_ == 0) return std::nullopt;
  return events::Measured{iteration, phase, std::exchange(iterations_, 0), std::exchange(steps_, {})};
}

}  // namespace traceflow
