#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/tensor.h"

// Vector and scalar quantisation for compressed files.
namespace traceflow {

// At most 256 numbers, ascending, that stand for many.
class Codebook {
 public:
  // Minimises the squared error of the finite values with Lloyd's algorithm. Exact where there are
  // no more than 256 different values.
  explicit Codebook(std::vector<float> values);
  const std::vector<float>& entries() const { return entries_; }
  // Of the nearest entry.
  uint8_t index_of(float value) const;

 private:
  std::vector<float> entries_;
};

struct Palette {
  Tensor<float> entries;         // P×D
  std::vector<uint16_t> labels;  // of each row
};

// At most `most` (a power of two, up to 65,536) vectors that stand for N rows, N×D, by median cut: the rows
// are halved along the coordinate with the largest variance until there are enough groups, and each entry is
// a group's mean. Every row has its own entry where N is at most `most`.
Palette make_palette(const Tensor<float>& rows, int64_t most);

}  // namespace traceflow
