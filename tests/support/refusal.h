#pragma once

#include <string>
#include <utility>

#include "base/error.h"

namespace traceflow {

// What f is refused with, the line of its InputError; "accepted" where there is none.
template <class F>
std::string refusal_of(F&& f) {
  try {
    std::forward<F>(f)();
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace traceflow
