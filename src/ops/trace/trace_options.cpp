#include "ops/trace/trace.h"

namespace traceflow::trace {

void Options::validate() const {
  check_option(t_min >= 0, "trace.t_min", t_min, "a distance, 0 or more");
  check_option(alpha_min > 0 && alpha_min < 1, "trace.alpha_min", alpha_min, "more than 0 and less than 1");
  check_option(alpha_max > alpha_min && alpha_max < 1, "trace.alpha_max", alpha_max,
               "more than alpha_min and less than 1");
  check_option(transmittance_min >= 0 && transmittance_min < 1, "trace.transmittance_min", transmittance_min,
               "0 or more and less than 1");
  check_option(hits_per_pass >= 1, "trace.hits_per_pass", hits_per_pass, "1 or more");
}

}  // namespace traceflow::trace
