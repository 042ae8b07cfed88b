#pragma once

#include <cstdint>
#include <string>
#include <tuple>

#include "base/device_memory.h"
#include "primitives/dtype.h"

// Matrix products on the CUDA device, by cuBLASLt. All matrices are row-major.
namespace traceflow::cuda {

// One bit per number of C: whether it was greater than 0.
enum class Mask {
  none,
  written,  // by a product with ReLU
  read,     // C = 0 where the bit is not set: the derivative of that ReLU
};

// What a product computes: C = A·B, then the requested steps, in this order. A is m×k, B k×n, C m×n. Sums are
// fp32 (never TF32). Rows start at multiples of 16 bytes.
struct GemmDescription {
  int64_t m, k, n;
  bool transposed_a = false;                      // A is stored k×m
  bool transposed_b = false;                      // B is stored n×k
  int64_t stride_a, stride_b, stride_c;           // numbers from one stored row to the next
  DType operands, result;                         // of A and B; of C
  bool accumulate = false;                        // C += what C held before
  bool bias = false;                              // C += bias: n numbers of C's type
  bool relu = false;                              // C = max(C, 0)
  Mask mask = Mask::none;                         // one row per row of C
  int64_t mask_stride = 0;                        // bits, a multiple of 128
  int64_t batches = 1;                            // number of products of this shape
  int64_t batch_a = 0, batch_b = 0, batch_c = 0;  // numbers from one product to the next

  bool has_epilogue() const { return bias || relu || mask != Mask::none; }
  // All members, so that descriptions can be compared.
  auto key() const {
    return std::tie(m, k, n, transposed_a, transposed_b, stride_a, stride_b, stride_c, operands, result,
                    accumulate, bias, relu, mask, mask_stride, batches, batch_a, batch_b, batch_c);
  }
  friend bool operator<(const GemmDescription& left, const GemmDescription& right) {
    return left.key() < right.key();
  }
};

struct GemmAddresses {
  const void* a;
  const void* b;
  void* c;
  const void* bias = nullptr;
  void* mask = nullptr;
};

// Whether cuBLASLt can be loaded; if not, why_not gives the reason.
TRACEFLOW_WITH_CUDA bool cublas_lt_answers(std::string& why_not);
// Whether the device can be used: this program has code for it, it responds, and cuBLASLt can be loaded. If
// not, why_not gives the reason.
inline bool is_ready(std::string& why_not) {
  why_not = "this program was built without CUDA";
  return answers != nullptr && answers(why_not) && cublas_lt_answers(why_not);
}
// Whether the library supports the product on this device. The first call prepares the product.
TRACEFLOW_WITH_CUDA bool supported(const GemmDescription& gemm);
// Enqueues the product on the stream; the same bytes every time. Throws InternalError if it is not supported.
TRACEFLOW_WITH_CUDA void multiply(const GemmDescription& gemm, const GemmAddresses& at);
// If false, products with a bias, a ReLU or a mask count as unsupported, so that tests reach the code that
// replaces these.
TRACEFLOW_WITH_CUDA void allow_epilogues(bool allowed);

}  // namespace traceflow::cuda
