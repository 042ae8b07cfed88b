#include <algorithm>
#include <vector>

#include "base/error.h"
#include "base/profile.h"
#include "emulation/device.h"
#include "math/bf16.h"
#include "primitives/gemm.h"

// Stands in for cuBLASLt: the same products in plain loops.
namespace traceflow::cuda {

namespace {

bool epilogues_allowed = true;

float load(DType number, const void* values, int64_t at) {
  return number == DType::fp32 ? static_cast<const float*>(values)[at]
                               : to_float(static_cast<const Bf16*>(values)[at]);
}

void save(DType number, float value, void* values, int64_t at) {
  if (number == DType::fp32) {
    static_cast<float*>(values)[at] = value;
  } else {
    store(value, static_cast<Bf16*>(values)[at]);
  }
}

// A stored matrix, or its transpose, dense and in fp32.
std::vector<float> dense(DType number, const void* from, int64_t first, int64_t rows, int64_t columns,
                         int64_t stride, bool transposed) {
  std::vector<float> to(static_cast<size_t>(rows * columns));
  for (int64_t i = 0; i < rows; ++i) {
    for (int64_t j = 0; j < columns; ++j) {
      const int64_t at = first + (transposed ? j * stride + i : i * stride + j);
      to[static_cast<size_t>(i * columns + j)] = load(number, from, at);
    }
  }
  return to;
}

int64_t bytes_of(DType number) { return number == DType::fp32 ? 4 : 2; }

// A stored matrix's bytes, row after row, of all batches.
struct Stored {
  uintptr_t begin;
  int64_t rows, row_bytes, stride_bytes, batches, batch_bytes;

  uintptr_t end() const {
    return begin +
           static_cast<uintptr_t>((batches - 1) * batch_bytes + (rows - 1) * stride_bytes + row_bytes);
  }
  // Whether none of its numbers is one of the other's, which may stand beside it in the same rows.
  bool apart_from(const Stored& other) const {
    if (end() <= other.begin || other.end() <= begin) return true;
    if (batches > 1 || other.batches > 1 || stride_bytes != other.stride_bytes) return false;
    const int64_t distance = static_cast<int64_t>(other.begin - begin) % stride_bytes;
    const int64_t column = distance < 0 ? distance + stride_bytes : distance;
    return column >= row_bytes && column + other.row_bytes <= stride_bytes;
  }
};

Stored stored(DType number, const void* address, int64_t rows, int64_t columns, int64_t stride,
              int64_t batches, int64_t batch_stride) {
  const int64_t size = bytes_of(number);
  return {reinterpret_cast<uintptr_t>(address),
          rows,
          columns * size,
          stride * size,
          batches,
          batch_stride * size};
}

// What the library refuses, or leaves undefined.
void check(const GemmDescription& p) {
  require(p.m > 0 && p.n > 0 && p.k > 0 && p.batches > 0, "a product has numbers");
  require(p.stride_a >= (p.transposed_a ? p.m : p.k) && p.stride_b >= (p.transposed_b ? p.k : p.n) &&
              p.stride_c >= p.n && (p.batches == 1 || p.batch_c >= p.m * p.stride_c),
          "rows do not overlap");
  const int64_t operands = bytes_of(p.operands), result = bytes_of(p.result);
  require(p.stride_a * operands % 16 == 0 && p.stride_b * operands % 16 == 0 && p.stride_c * result % 16 == 0,
          "rows are aligned");
  require(p.batch_a * operands % 16 == 0 && p.batch_b * operands % 16 == 0 && p.batch_c * result % 16 == 0,
          "batches are aligned");
  require(p.operands == p.result || p.result == DType::fp32, "the library has the numbers' types");
  require(!p.has_epilogue() || p.batches == 1, "what follows a product follows one alone");
  require(p.mask == Mask::none || (p.mask_stride % 128 == 0 && p.mask_stride >= p.n), "a mask's rows fit");
  require(p.mask != Mask::written || p.relu, "a ReLU writes the mask");
  require(p.mask != Mask::read || (!p.bias && !p.relu && p.k > 1), "the mask alone follows the product");
}

void check(const GemmDescription& p, const GemmAddresses& at) {
  require((at.bias != nullptr || !p.bias) && (at.mask != nullptr || p.mask == Mask::none),
          "a product has what follows it");
  for (const void* address :
       {at.a, at.b, static_cast<const void*>(at.c), at.bias, static_cast<const void*>(at.mask)}) {
    require(reinterpret_cast<uintptr_t>(address) % 16 == 0, "addresses are aligned");
    require(address == nullptr || emulation::on_device(address), "addresses are the device's");
  }
  const Stored c = stored(p.result, at.c, p.m, p.n, p.stride_c, p.batches, p.batch_c);
  const Stored a = stored(p.operands, at.a, p.transposed_a ? p.k : p.m, p.transposed_a ? p.m : p.k,
                          p.stride_a, p.batches, p.batch_a);
  const Stored b = stored(p.operands, at.b, p.transposed_b ? p.n : p.k, p.transposed_b ? p.k : p.n,
                          p.stride_b, p.batches, p.batch_b);
  require(c.apart_from(a) && c.apart_from(b), "a product does not write what it reads");
}

void finish_row(const GemmDescription& p, const GemmAddresses& at, int64_t batch, int64_t i,
                std::vector<float>& row) {
  const int64_t first = batch * p.batch_c + i * p.stride_c;
  auto* const bits = static_cast<uint8_t*>(at.mask) + (at.mask == nullptr ? 0 : i * p.mask_stride / 8);
  // Nothing is said of the bits behind a row's last.
  if (p.mask == Mask::written) std::fill_n(bits, p.mask_stride / 8, uint8_t{0xff});
  for (int64_t j = 0; j < p.n; ++j) {
    float value = row[static_cast<size_t>(j)];
    const auto bit = static_cast<uint8_t>(1U << j % 8);
    if (p.accumulate) value += load(p.result, at.c, first + j);
    if (p.bias) value += load(p.result, at.bias, j);
    if (p.mask == Mask::written) {
      bits[j / 8] = static_cast<uint8_t>(value > 0 ? bits[j / 8] | bit : bits[j / 8] & ~bit);
    }
    if (p.relu) value = value > 0 ? value : 0;
    if (p.mask == Mask::read && (bits[j / 8] & bit) == 0) value = 0;
    save(p.result, value, at.c, first + j);
  }
}

}  // namespace

bool cublas_lt_answers(std::string&) { return true; }
bool supported(const GemmDescription& gemm) { return epilogues_allowed || !gemm.has_epilogue(); }
void allow_epilogues(bool allowed) { epilogues_allowed = allowed; }

void multiply(const GemmDescription& gemm, const GemmAddresses& at) {
  const profile::Scope scope("matrix product");
  require(supported(gemm), "the product is supported");
  check(gemm);
  check(gemm, at);
  const emulation::DeviceAccess access;
  std::vector<float> row(static_cast<size_t>(gemm.n));
  for (int64_t batch = 0; batch < gemm.batches; ++batch) {
    const auto a =
        dense(gemm.operands, at.a, batch * gemm.batch_a, gemm.m, gemm.k, gemm.stride_a, gemm.transposed_a);
    const auto b =
        dense(gemm.operands, at.b, batch * gemm.batch_b, gemm.k, gemm.n, gemm.stride_b, gemm.transposed_b);
    for (int64_t i = 0; i < gemm.m; ++i) {
      std::fill(row.begin(), row.end(), 0.0F);
      for (int64_t l = 0; l < gemm.k; ++l) {
        const float factor = a[static_cast<size_t>(i * gemm.k + l)];
        const float* const from = b.data() + l * gemm.n;
        for (int64_t j = 0; j < gemm.n; ++j) row[static_cast<size_t>(j)] += factor * from[j];
      }
      finish_row(gemm, at, batch, i, row);
    }
  }
}

}  // namespace traceflow::cuda
