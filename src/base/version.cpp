#include "base/version.h"

namespace traceflow {

const char* version() { return TRACEFLOW_VERSION; }

}  // namespace traceflow
