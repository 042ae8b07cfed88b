#pragma once

#include "eval/motion_error.h"
#include "viz/subject.h"

namespace traceflow::eval {

// The finite main surfels of a subject that are opaque at time 0 (opacity above 0.5), posed as in renders of
// it. Refers to the subject, which must outlive it.
Carriers carriers_of(const viz::Subject& subject);

}  // namespace traceflow::eval
