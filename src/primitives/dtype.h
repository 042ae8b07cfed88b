#pragma once

namespace traceflow {

// The number types of matrices.
enum class DType { fp32, bf16 };

}  // namespace traceflow
