#pragma once

namespace traceflow::bench {

// CPU time of the calling thread: what a shared machine leaves of a second does not enter.
double cpu_seconds();

// Multiply-adds in registers on one core with the widest vectors it has: 10⁹ floating-point operations a
// second of CPU time, the best of several rounds. 0 where the core has no bf16 dot products.
double peak_fp32();
double peak_bf16();

}  // namespace traceflow::bench
