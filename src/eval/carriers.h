#pragma once

#include "eval/motion_error.h"
#include "viz/subject.h"

namespace traceflow::eval {

// The main surfels of a subject that are finite and, at time 0, opaque (opacity above a half), posed as
// pictures of it show them. Refers to the subject, which must outlive it.
Carriers carriers_of(const viz::Subject& subject);

}  // namespace traceflow::eval
