#pragma once

#include <cstdint>
#include <memory>
#include <tuple>

#include "primitives/dtype.h"

// Matrix products on one thread, by oneDNN. All matrices are dense and row-major, except that a B that is
// used often can be packed into the order in which the product reads it.
namespace traceflow::field {

// What a product computes: C = A·B, then the requested steps, in this order. A is m×k, or stored k×m and read
// transposed; B is k×n; C is m×n. Sums are fp32.
struct GemmShape {
  int64_t m, k, n;
  DType operands = DType::fp32;  // of A and B
  DType result = DType::fp32;    // of C
  bool transposed = false;       // A is stored k×m
  int64_t packed_for = 0;        // B is packed for this product with this m; 0: not packed
  bool bias = false;             // C += bias, one fp32 number per column
  bool accumulate = false;       // C += what C held before
  bool relu = false;             // C = max(C, 0)

  // All members, so that shapes can be compared.
  auto key() const {
    return std::tie(m, k, n, operands, result, transposed, packed_for, bias, accumulate, relu);
  }
  friend bool operator<(const GemmShape& left, const GemmShape& right) { return left.key() < right.key(); }
};

// One compiled product. run() may be called by any number of threads at once and never starts others. Its
// result does not depend on the program's number of threads.
class Gemm {
 public:
  ~Gemm();
  Gemm(const Gemm&) = delete;
  Gemm& operator=(const Gemm&) = delete;

  // Bytes of a packed B.
  int64_t packed_bytes() const;
  // Packs B(i, j) = b[i·row_stride + j·column_stride], rounded to the operands' type.
  void pack(const float* b, int64_t row_stride, int64_t column_stride, void* packed) const;

  void run(const void* a, const void* b, const float* bias, void* c) const;

 private:
  friend const Gemm& gemm(const GemmShape& shape);
  explicit Gemm(const GemmShape& shape);

  struct Compiled;
  struct Arguments;
  std::unique_ptr<const Compiled> compiled_;
};

// The product for a shape, compiled on first use and kept until the program ends.
const Gemm& gemm(const GemmShape& shape);

}  // namespace traceflow::field
