#pragma once

#include <cstdint>
#include <vector>

#include "ops/trace/trace_bvh.h"

// The shape of the tree alone, from boxes: first a binary tree, then its nodes gathered into wide ones. Knows
// nothing of surfels.
namespace traceflow::trace {

using Float4 = float __attribute__((vector_size(16)));

// min and max lane by lane.
inline Float4 lower_of(Float4 a, Float4 b) { return a < b ? a : b; }
inline Float4 upper_of(Float4 a, Float4 b) { return a > b ? a : b; }

struct Box {
  Float4 lower = Float4{} + std::numeric_limits<float>::max();
  Float4 upper = Float4{} - std::numeric_limits<float>::max();

  void add(const Box& other) {
    lower = lower_of(lower, other.lower);
    upper = upper_of(upper, other.upper);
  }
  void add_point(Float4 p) {
    lower = lower_of(lower, p);
    upper = upper_of(upper, p);
  }
  // Half the surface, the measure of how often a ray meets the box.
  float area() const {
    const Float4 d = upper - lower;
    return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
  }
  // Twice the centre.
  Float4 centre2() const { return lower + upper; }
};

struct BoxItem {
  Box box;  // the fourth lanes are 0
  uint32_t index;
};

// Over items [begin, end) of the sorted array. A leaf, with at most bvh_width items, has no children: left is
// 0. Otherwise both children stand behind their parent.
struct BinaryNode {
  Box box;
  uint32_t begin = 0, end = 0;
  uint32_t left = 0, right = 0;
};

// Sorts `items`; the root is node 0. Empty for no items. Depends on the items and their order only.
std::vector<BinaryNode> build_binary_tree(std::vector<BoxItem>& items);

// Wide nodes that cost a ray least, and the leaves of the binary tree in the order of their numbers in
// `nodes`.
struct WideTree {
  std::vector<BvhNode> nodes;
  std::vector<uint32_t> leaves;
};
WideTree widen(const std::vector<BinaryNode>& binary);

}  // namespace traceflow::trace
