#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "math/blend.h"
#include "math/rotation.h"
#include "ops/trace/cpu/trace.h"
#include "ops/trace/cpu/tree.h"
#include "ops/trace/trace_bvh.h"
#include "ops/trace/trace_disk.h"
#include "ops/trace/trace_usable.h"

namespace traceflow::trace {

namespace {

Box widen_to_vectors(const DiskBox& disk) {
  Box box;
  box.lower = Float4{disk.lower.x, disk.lower.y, disk.lower.z, 0};
  box.upper = Float4{disk.upper.x, disk.upper.y, disk.upper.z, 0};
  return box;
}

// Boxes of the surfels that can be hit, in the order of the surfels.
std::vector<BoxItem> make_items(const PosedSurfels& surfels, const BlendRules<float>& rules) {
  constexpr int64_t grain = 4096;
  const int64_t count = surfels.count();
  const SurfelView<float> view(surfels);
  std::vector<std::vector<BoxItem>> parts(static_cast<size_t>((count + grain - 1) / grain));
  parallel_blocks("trace boxes", count, grain, [&](int64_t begin, int64_t end) {
    std::vector<BoxItem>& part = parts[static_cast<size_t>(begin / grain)];
    part.reserve(static_cast<size_t>(end - begin));
    for (int64_t i = begin; i < end; ++i) {
      if (!view.is_usable(i, rules.alpha_min)) continue;
      const DiskBox box = disk_box(view.frame(i), std::sqrt(cutoff_radius2(rules, surfels.opacity[i])));
      if (box.is_bounded()) part.push_back({widen_to_vectors(box), static_cast<uint32_t>(i)});
    }
  });
  std::vector<BoxItem> items;
  items.reserve(static_cast<size_t>(count));
  for (const auto& part : parts) items.insert(items.end(), part.begin(), part.end());
  return items;
}

void set_slot(const PosedSurfels& surfels, const BlendRules<float>& rules, uint32_t i, int slot,
              BvhLeaf& leaf) {
  const Mat3<float> rotation = rotation_from_quaternion(load4<float>(surfels.rotation.row(i)));
  for (int axis = 0; axis < 3; ++axis) {
    leaf.position[axis][slot] = surfels.position(i, axis);
    leaf.u[axis][slot] = rotation[0][axis] / surfels.scale(i, 0);
    leaf.v[axis][slot] = rotation[1][axis] / surfels.scale(i, 1);
    leaf.normal[axis][slot] = rotation[2][axis];
  }
  leaf.log_opacity[slot] = std::log(surfels.opacity[i]);
  leaf.radius[slot] = 1.00001F * std::sqrt(cutoff_radius2(rules, surfels.opacity[i])) *
                      std::max(surfels.scale(i, 0), surfels.scale(i, 1));
  leaf.surfel[slot] = i;
}

BvhLeaf make_leaf(const PosedSurfels& surfels, const BlendRules<float>& rules,
                  const std::vector<BoxItem>& items, const BinaryNode& group) {
  BvhLeaf leaf{};
  std::fill_n(leaf.log_opacity, bvh_width, -std::numeric_limits<float>::infinity());
  for (uint32_t i = group.begin; i < group.end; ++i) {
    set_slot(surfels, rules, items[i].index, static_cast<int>(i - group.begin), leaf);
  }
  for (int axis = 0; axis < 3; ++axis) {
    leaf.lower[axis] = group.box.lower[axis];
    leaf.upper[axis] = group.box.upper[axis];
  }
  return leaf;
}

// The median of half the diagonals, which outliers do not affect.
float typical_leaf_size(const std::vector<BinaryNode>& binary, const std::vector<uint32_t>& leaves) {
  if (leaves.empty()) return 0;
  std::vector<float> sizes(leaves.size());
  std::transform(leaves.begin(), leaves.end(), sizes.begin(), [&](uint32_t leaf) {
    const Float4 d = binary[leaf].box.upper - binary[leaf].box.lower;
    return 0.5F * std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  });
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle;
}

}  // namespace

void cpu::build(const PosedSurfels& surfels, const Options& options, Bvh& bvh) {
  const BlendRules<float> rules{options.alpha_min, options.alpha_max, options.transmittance_min};
  std::vector<BoxItem> items = make_items(surfels, rules);
  const std::vector<BinaryNode> binary = build_binary_tree(items);
  WideTree wide = widen(binary);
  bvh.nodes.swap(wide.nodes);
  bvh.leaves.resize(wide.leaves.size());
  bvh.surfels = surfels.count();
  bvh.leaf_size = typical_leaf_size(binary, wide.leaves);
  parallel_for(
      "trace leaves", static_cast<int64_t>(bvh.leaves.size()),
      [&](int64_t i) {
        const auto k = static_cast<size_t>(i);
        bvh.leaves[k] = make_leaf(surfels, rules, items, binary[wide.leaves[k]]);
      },
      64);
}

}  // namespace traceflow::trace
