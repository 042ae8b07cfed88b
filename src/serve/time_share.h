#pragma once

#include <algorithm>

#include "serve/audience/audience.h"

namespace traceflow::serve {

// An account of the time that pages may take from a training: `share` of the whole. What nobody uses is saved
// up to one second, enough for the first pictures of somebody who comes; whoever moves the camera may run
// into as much debt.
class TimeShare {
 public:
  // Above 0 and under 1.
  explicit TimeShare(double share) : per_second_(share / (1 - share)) {}

  // Seconds that went into the training, and into pages.
  void trained(double seconds) { credit_ = std::min(most_credit, credit_ + seconds * per_second_); }
  void spent(double seconds) { credit_ -= seconds; }

  // Whether anything may be made now.
  bool is_open() const { return credit_ > -most_debt; }
  // What only becomes finer or newer waits until there is time for it.
  Allowed allowed() const { return {credit_ > 0, credit_ >= most_credit / 2}; }

  static constexpr double most_credit = 1, most_debt = 1;  // seconds

 private:
  double per_second_;
  double credit_ = 0;
};

}  // namespace traceflow::serve
