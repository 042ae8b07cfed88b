#include <algorithm>
#include <array>

#include "ops/trace/cpu/tree.h"

// Dynamic programming chooses which nodes of the binary tree become wide nodes and which are skipped. It
// minimises the sum of the areas of all that a ray may have to visit.
namespace traceflow::trace {

namespace {

// The cost of visiting a leaf and a node.
constexpr float leaf_cost = 0.8F;
constexpr float node_cost = 1.0F;

// For one binary node: the cost of representing its subtree by at most k+1 children of a wide node, and how
// many of these the left half gets (0: at most k children cost as little).
struct Choices {
  std::array<float, bvh_width> cost;
  std::array<uint8_t, bvh_width> left;
};

// The cheapest way to share `roots` children between the halves.
std::pair<float, int> best_share(const Choices& left, const Choices& right, int roots) {
  std::pair<float, int> best{std::numeric_limits<float>::max(), 1};
  for (int k = 1; k < roots; ++k) {
    const float cost = left.cost[static_cast<size_t>(k - 1)] + right.cost[static_cast<size_t>(roots - k - 1)];
    if (cost < best.first) best = {cost, k};
  }
  return best;
}

std::vector<Choices> choose(const std::vector<BinaryNode>& binary) {
  std::vector<Choices> choices(binary.size());
  for (size_t i = binary.size(); i-- > 0;) {
    const BinaryNode& node = binary[i];
    Choices& c = choices[i];
    c.left.fill(0);
    if (!node.left) {
      c.cost.fill(leaf_cost * node.box.area());
      continue;
    }
    std::array<std::pair<float, int>, bvh_width + 1> share;
    for (int roots = 2; roots <= bvh_width; ++roots) {
      share[static_cast<size_t>(roots)] = best_share(choices[node.left], choices[node.right], roots);
    }
    c.cost[0] = node_cost * node.box.area() + share[bvh_width].first;
    for (size_t roots = 2; roots <= bvh_width; ++roots) {
      const bool better = share[roots].first < c.cost[roots - 2];
      c.cost[roots - 1] = better ? share[roots].first : c.cost[roots - 2];
      c.left[roots - 1] = better ? static_cast<uint8_t>(share[roots].second) : uint8_t{0};
    }
  }
  return choices;
}

class Widener {
 public:
  explicit Widener(const std::vector<BinaryNode>& binary) : binary_(binary), choices_(choose(binary)) {}

  WideTree run() {
    if (!binary_.empty()) add_node(0);
    return std::move(out_);
  }

 private:
  uint32_t add_node(uint32_t from) {
    const auto index = static_cast<uint32_t>(out_.nodes.size());
    out_.nodes.push_back(empty_node());
    std::array<uint32_t, bvh_width> children;
    const int count = list_children(from, children);
    for (int k = 0; k < count; ++k) {
      const uint32_t child = children[static_cast<size_t>(k)];
      set_box(binary_[child].box, k, out_.nodes[index]);
      const uint32_t reference = binary_[child].left ? add_node(child) : add_leaf(child);
      out_.nodes[index].child[k] = reference;
    }
    return index;
  }
  uint32_t add_leaf(uint32_t from) {
    out_.leaves.push_back(from);
    return leaf_bit | static_cast<uint32_t>(out_.leaves.size() - 1);
  }

  int list_children(uint32_t node, std::array<uint32_t, bvh_width>& children) const {
    int count = 0;
    if (binary_[node].left) {
      const auto [left, right] = std::pair(binary_[node].left, binary_[node].right);
      const int to_left = best_share(choices_[left], choices_[right], bvh_width).second;
      gather(left, to_left, children, count);
      gather(right, bvh_width - to_left, children, count);
    } else {
      children[static_cast<size_t>(count++)] = node;  // a tree with one leaf
    }
    return count;
  }

  void gather(uint32_t node, int roots, std::array<uint32_t, bvh_width>& children, int& count) const {
    const auto& left = choices_[node].left;
    while (roots > 1 && left[static_cast<size_t>(roots - 1)] == 0) --roots;
    if (roots == 1) {
      children[static_cast<size_t>(count++)] = node;
      return;
    }
    const int to_left = left[static_cast<size_t>(roots - 1)];
    gather(binary_[node].left, to_left, children, count);
    gather(binary_[node].right, roots - to_left, children, count);
  }

  static BvhNode empty_node() {
    BvhNode node;
    constexpr float inf = std::numeric_limits<float>::infinity();
    std::fill_n(&node.lower[0][0], 3 * bvh_width, inf);
    std::fill_n(&node.upper[0][0], 3 * bvh_width, -inf);
    std::fill_n(node.child, bvh_width, 0U);
    return node;
  }
  static void set_box(const Box& box, int slot, BvhNode& node) {
    for (int axis = 0; axis < 3; ++axis) {
      node.lower[axis][slot] = box.lower[axis];
      node.upper[axis][slot] = box.upper[axis];
    }
  }

  const std::vector<BinaryNode>& binary_;
  std::vector<Choices> choices_;
  WideTree out_;
};

}  // namespace

WideTree widen(const std::vector<BinaryNode>& binary) { return Widener(binary).run(); }

}  // namespace traceflow::trace
