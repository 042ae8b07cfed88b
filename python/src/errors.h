#pragma once

#include <stdexcept>

namespace traceflow::python {

// A training that could not go on.
class TrainingEnded : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace traceflow::python
