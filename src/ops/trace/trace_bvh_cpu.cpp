#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "math/blend.h"
#include "math/rotation.h"
#include "ops/trace/trace_bvh.h"
#include "ops/trace/trace_tree.h"
#include "ops/trace/trace_usable.h"

namespace traceflow::trace {

namespace {

// The box of a disk: of an ellipse with half axes a t_u and b t_v. Wider by what rounding may move a hit.
Box disk_box(const PosedSurfels& surfels, int64_t i, float radius) {
  const Mat3<float> rotation = rotation_from_quaternion(load4<float>(surfels.rotation.row(i)));
  const Vec3<float> a = radius * surfels.scale(i, 0) * rotation[0];
  const Vec3<float> b = radius * surfels.scale(i, 1) * rotation[1];
  Box box;
  box.lower = box.upper = Float4{};
  for (int axis = 0; axis < 3; ++axis) {
    const float centre = surfels.position(i, axis);
    const float half = std::sqrt(a[axis] * a[axis] + b[axis] * b[axis]);
    const float margin = 2e-6F * (std::abs(centre) + std::max(glm::length(a), glm::length(b)));
    box.lower[axis] = centre - half - margin;
    box.upper[axis] = centre + half + margin;
  }
  return box;
}

// Larger boxes would overflow where areas and centres are computed.
bool is_bounded(const Box& box) {
  constexpr float limit = 1e15F;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(box.lower[axis] > -limit && box.upper[axis] < limit)) return false;
  }
  return true;
}

// Boxes of the surfels that can be hit, in the order of the surfels.
std::vector<BoxItem> make_items(const PosedSurfels& surfels, const BlendRules<float>& rules) {
  constexpr int64_t grain = 4096;
  const int64_t count = surfels.count();
  std::vector<std::vector<BoxItem>> parts(static_cast<size_t>((count + grain - 1) / grain));
  parallel_blocks("trace boxes", count, grain, [&](int64_t begin, int64_t end) {
    std::vector<BoxItem>& part = parts[static_cast<size_t>(begin / grain)];
    part.reserve(static_cast<size_t>(end - begin));
    for (int64_t i = begin; i < end; ++i) {
      if (!is_usable(surfels, i, rules.alpha_min)) continue;
      const Box box = disk_box(surfels, i, std::sqrt(cutoff_radius2(rules, surfels.opacity[i])));
      if (is_bounded(box)) part.push_back({box, static_cast<uint32_t>(i)});
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

// The median of half the diagonals, which stray surfels do not move.
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

void BvhDeleter::operator()(Bvh* bvh) const { delete bvh; }
BvhPtr make_bvh() { return BvhPtr(new Bvh); }

void build(const PosedSurfels& surfels, const Options& options, Bvh& bvh) {
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
