#pragma once

namespace traceflow {

// The program's version, as "0.1.0".
const char* version();

}  // namespace traceflow
