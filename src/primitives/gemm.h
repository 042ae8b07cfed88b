#pragma once

#include <cstdint>
#include <string>
#include <tuple>

#include "base/device_memory.h"
#include "primitives/dtype.h"

// Matrix products on the CUDA device, by cuBLASLt. All matrices are row-major.
namespace traceflow::cuda {

// One bit for each number of C: whether it was greater than 0.
enum class Mask {
  none,
  written,  // by a product with ReLU
  read,     // C = 0 where the bit is not set: the derivative of that ReLU
};

// What a product computes: C = A·B, then the parts that are asked for, in this order. A is m×k, B k×n, C m×n.
// Sums are fp32 (never TF32). Rows start at multiples of 16 bytes.
struct GemmDescription {
  int64_t m, k, n;
  bool transposed_a = false;                      // A is stored k×m
  bool transposed_b = false;                      // B is stored n×k
  int64_t stride_a, stride_b, stride_c;           // numbers from a stored row to the next
  DType operands, result;                         // of A and B, and of C
  bool accumulate = false;                        // C += what C held before
  bool bias = false;                              // C += bias: n numbers of C's type
  bool relu = false;                              // C = max(C, 0)
  Mask mask = Mask::none;                         // one row a row of C
  int64_t mask_stride = 0;                        // bits, a multiple of 128
  int64_t batches = 1;                            // as many products of this shape
  int64_t batch_a = 0, batch_b = 0, batch_c = 0;  // numbers from one to the next

  bool has_epilogue() const { return bias || relu || mask != Mask::none; }
  // All of it, so that descriptions can be compared.
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

// Whether the library of products is there; where not, why.
TRACEFLOW_WITH_CUDA bool cublas_lt_answers(std::string& why_not);
// Whether the device can be used: code for it, an answer from it, and that library; where not, why.
inline bool is_ready(std::string& why_not) {
  why_not = "this program was built without CUDA";
  return answers != nullptr && answers(why_not) && cublas_lt_answers(why_not);
}
// Whether there is code for the product on this device. Asking once makes the product ready.
TRACEFLOW_WITH_CUDA bool supported(const GemmDescription& gemm);
// Puts the product on the stream; the same bytes every time. Throws InternalError where it is not supported.
TRACEFLOW_WITH_CUDA void multiply(const GemmDescription& gemm, const GemmAddresses& at);
// With false, products with a bias, a ReLU or a mask count as not supported: how tests reach what stands in
// for them.
TRACEFLOW_WITH_CUDA void allow_epilogues(bool allowed);

}  // namespace traceflow::cuda
