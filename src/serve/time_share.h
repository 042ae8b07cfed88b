#pragma once

#include <algorithm>

#include "serve/clients/clients.h"

namespace traceflow::serve {

// Limits the share of a training's time that rendering for pages takes, as a token bucket. Up to one second
// of unused time is saved, enough for the first pictures of a new page. A moving camera may overdraw by as
// much.
class TimeShare {
 public:
  // Above 0 and under 1.
  explicit TimeShare(double share) : per_second_(share / (1 - share)) {}

  // Seconds that went into the training, and into pages.
  void trained(double seconds) { credit_ = std::min(most_credit, credit_ + seconds * per_second_); }
  void spent(double seconds) { credit_ -= seconds; }

  // Whether anything may be made now.
  bool is_open() const { return credit_ > -most_debt; }
  // Finer and newer frames wait until there is time for them.
  Allowed allowed() const { return {credit_ > 0, credit_ >= most_credit / 2}; }

  static constexpr double most_credit = 1, most_debt = 1;  // seconds

 private:
  double per_second_;
  double credit_ = 0;
};

}  // namespace traceflow::serve
