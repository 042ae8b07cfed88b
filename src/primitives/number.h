#pragma once

namespace traceflow {

// The number types of matrices.
enum class Number { fp32, bf16 };

}  // namespace traceflow
