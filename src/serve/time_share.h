#pragma once

#include <algorithm>

#include "serve/clients/clients.h"

namespace traceflow::serve {

// Limits the fraction of a training's time that is spent on rendering for pages, as a token bucket. Up to one
// second of unused time is saved for the first pictures of a new page. A moving camera may overdraw by the
// same amount.
class TimeShare {
 public:
  // share: above 0 and below 1.
  explicit TimeShare(double share) : per_second_(share / (1 - share)) {}

  // Record seconds spent on the training, and on pages.
  void trained(double seconds) { credit_ = std::min(most_credit, credit_ + seconds * per_second_); }
  void spent(double seconds) { credit_ -= seconds; }

  // Whether rendering is allowed now.
  bool is_open() const { return credit_ > -most_debt; }
  // Finer and newer frames wait until time is available.
  Allowed allowed() const { return {credit_ > 0, credit_ >= most_credit / 2}; }

  static constexpr double most_credit = 1, most_debt = 1;  // seconds

 private:
  double per_second_;
  double credit_ = 0;
};

}  // namespace traceflow::serve
