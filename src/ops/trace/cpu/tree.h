#pragma once

#include <cstdint>
#include <vector>

#include "ops/trace/trace_bvh.h"

// Builds the tree from boxes: first a binary tree, whose nodes are then merged into wide ones. Independent of
// surfels.
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
  // Half the surface area, which is proportional to the probability that a ray meets the box.
  float area() const {
    const Float4 d = upper - lower;
    return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
  }
  // Twice the centre.
  Float4 centre2() const { return lower + upper; }
};

struct BoxItem {
  Box box;  // the fourth lane is 0
  uint32_t index;
};

// A node over items [begin, end) of the sorted array. A leaf has at most bvh_width items and no children:
// left is 0. Otherwise both children have higher indices than their parent.
struct BinaryNode {
  Box box;
  uint32_t begin = 0, end = 0;
  uint32_t left = 0, right = 0;
};

// Sorts `items`. Node 0 is the root; returns no nodes for no items. The result depends only on the items and
// their order.
std::vector<BinaryNode> build_binary_tree(std::vector<BoxItem>& items);

// The wide nodes with the lowest cost per ray, and the leaves of the binary tree in the order of their
// numbers in `nodes`.
struct WideTree {
  std::vector<BvhNode> nodes;
  std::vector<uint32_t> leaves;
};
WideTree widen(const std::vector<BinaryNode>& binary);

}  // namespace traceflow::trace
