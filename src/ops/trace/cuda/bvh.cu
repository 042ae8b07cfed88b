#include "base/kernel.h"
#include "math/blend.h"
#include "ops/trace/cuda/trace.h"
#include "ops/trace/trace_bvh.h"
#include "ops/trace/trace_disk.h"
#include "primitives/sort.h"

// Builds the tree from scratch (Karras 2012): computes keys along a space-filling curve, sorts them, builds
// all nodes at once from the keys, and the boxes from the leaves up.
namespace traceflow::trace::cuda {

using namespace traceflow::cuda;

namespace {

constexpr int build_threads = 256;
constexpr uint64_t left_out = uint64_t{1} << 63;  // greater than every key of the curve
constexpr uint32_t no_parent = 0xffffffffU;

// Integers in the same order as the floats; 0 is less than all of them.
__device__ uint32_t to_ordered(float x) {
  const uint32_t bits = __float_as_uint(x);
  return bits >> 31 != 0 ? ~bits : bits | 0x80000000U;
}
__device__ float from_ordered(uint32_t x) { return __uint_as_float(x >> 31 != 0 ? x & 0x7fffffffU : ~x); }

__device__ uint32_t warp_max(uint32_t value) {
  for (int by = warp_lanes / 2; by > 0; by /= 2) {
    const uint32_t other = __shfl_xor_sync(full_warp, value, by);
    value = other > value ? other : value;
  }
  return value;
}

struct BuildInput {
  SurfelView<float> surfels;
  int64_t count;
  BlendRules<float> rules;
};

__device__ DiskBox box_of(const BuildInput& input, int64_t i) {
  return disk_box(input.surfels.frame(i), std::sqrt(cutoff_radius2(input.rules, input.surfels.opacity[i])));
}

// Finds the surfels that can be hit, and the bounds of their centres: bounds is the largest of x, y, z, -x,
// -y, -z, as ordered integers.
__global__ void __launch_bounds__(build_threads)
    choose_surfels(BuildInput input, uint64_t* keys, uint32_t* indices, uint32_t* bounds) {
  const int64_t i = int64_t{blockIdx.x} * blockDim.x + threadIdx.x;
  uint32_t largest[6] = {};
  if (i < input.count) {
    const bool usable = input.surfels.is_usable(i, input.rules.alpha_min) && box_of(input, i).is_bounded();
    keys[i] = usable ? 0 : left_out;
    indices[i] = static_cast<uint32_t>(i);
    for (int axis = 0; usable && axis < 3; ++axis) {
      largest[axis] = to_ordered(input.surfels.position[3 * i + axis]);
      largest[axis + 3] = to_ordered(-input.surfels.position[3 * i + axis]);
    }
  }
  for (int k = 0; k < 6; ++k) {
    const uint32_t of_warp = warp_max(largest[k]);
    if (threadIdx.x % warp_lanes == 0 && of_warp != 0) atomicMax(bounds + k, of_warp);
  }
}

// Moves the lower 21 bits to bits 0, 3, 6, …
__device__ uint64_t spread_bits(uint64_t x) {
  x = (x | x << 32) & 0x001f00000000ffffU;
  x = (x | x << 16) & 0x001f0000ff0000ffU;
  x = (x | x << 8) & 0x100f00f00f00f00fU;
  x = (x | x << 4) & 0x10c30c30c30c30c3U;
  return (x | x << 2) & 0x1249249249249249U;
}

__global__ void __launch_bounds__(build_threads)
    make_keys(const float* position, int64_t count, const uint32_t* bounds, uint64_t* keys) {
  const int64_t i = int64_t{blockIdx.x} * blockDim.x + threadIdx.x;
  if (i >= count || keys[i] == left_out) return;
  constexpr float cells = 2097151.0F;
  float lower[3], extent = 0;
  for (int axis = 0; axis < 3; ++axis) {
    lower[axis] = -from_ordered(bounds[axis + 3]);
    extent = std::fmax(extent, from_ordered(bounds[axis]) - lower[axis]);
  }
  uint64_t key = 0;
  for (int axis = 0; axis < 3; ++axis) {
    // If there is one centre only, or all coincide, any key is valid.
    const float cell = extent > 0 ? (position[3 * i + axis] - lower[axis]) / extent * cells : 0.0F;
    key |= spread_bits(static_cast<uint64_t>(std::fmin(std::fmax(cell, 0.0F), cells))) << axis;
  }
  keys[i] = key;
}

// The number of leading bits that the keys at positions i and j share. The position distinguishes equal keys.
struct Keys {
  const uint64_t* key;
  int count;

  __device__ int shared_bits(int i, int64_t j) const {
    if (j < 0 || j >= count) return -1;
    const uint64_t different = key[i] ^ key[j];
    if (different == 0) return 64 + __clz(i ^ static_cast<int>(j));
    return __clzll(static_cast<long long>(different));
  }
};

struct TreeView {
  Node* nodes;
  uint32_t *disk_parent, *node_parent, *arrived;
};

__device__ void set_child(const TreeView& tree, uint32_t node, uint32_t side, uint32_t child, bool is_disk) {
  tree.nodes[node].child[side] = is_disk ? child | disk_bit : child;
  tree.nodes[node].unused[side] = 0;  // traversals load it with the rest
  (is_disk ? tree.disk_parent : tree.node_parent)[child] = 2 * node + side;
}

// A single disk also needs a root, whose right child is empty.
__device__ void make_lone_root(const TreeView& tree) {
  set_child(tree, 0, 0, 0, true);
  tree.arrived[0] = 0;
  tree.nodes[0].child[1] = no_child;
  tree.nodes[0].unused[1] = 0;
  for (int axis = 0; axis < 3; ++axis) {
    tree.nodes[0].box[axis][2] = INFINITY;
    tree.nodes[0].box[axis][3] = -INFINITY;
  }
}

// Node i covers all keys that share more bits with key i than key i shares with its neighbour on the other
// side. It is split where those keys first differ.
__global__ void __launch_bounds__(build_threads) make_nodes(Keys keys, TreeView tree) {
  const int64_t index = int64_t{blockIdx.x} * blockDim.x + threadIdx.x;
  if (index == 0) tree.node_parent[0] = no_parent;
  if (index == 0 && keys.count == 1) make_lone_root(tree);
  if (index >= keys.count - 1) return;
  const int i = static_cast<int>(index);
  const int step = keys.shared_bits(i, i + 1) > keys.shared_bits(i, i - 1) ? 1 : -1;
  const int least = keys.shared_bits(i, i - step);
  int64_t bound = 2;
  while (keys.shared_bits(i, i + bound * step) > least) bound *= 2;
  int64_t length = 0;
  for (int64_t more = bound / 2; more > 0; more /= 2) {
    if (keys.shared_bits(i, i + (length + more) * step) > least) length += more;
  }
  const int other_end = static_cast<int>(i + length * step);
  const int common = keys.shared_bits(i, other_end);
  int64_t split = 0;
  for (int64_t more = length; more > 1;) {
    more = (more + 1) / 2;
    if (keys.shared_bits(i, i + (split + more) * step) > common) split += more;
  }
  const int cut = static_cast<int>(i + split * step) + (step < 0 ? -1 : 0);
  const int first = step > 0 ? i : other_end, last = step > 0 ? other_end : i;
  const auto node = static_cast<uint32_t>(i), left = static_cast<uint32_t>(cut);
  tree.arrived[node] = 0;
  set_child(tree, node, 0, left, first == cut);
  set_child(tree, node, 1, left + 1, last == cut + 1);
}

__device__ Disk make_disk(const BuildInput& input, uint32_t surfel) {
  const SurfelFrame<float> f = input.surfels.frame(surfel);
  return {{f.position, std::log(input.surfels.opacity[surfel]), f.rotation[2], surfel},
          {f.rotation[0] / f.scale.x, f.rotation[1] / f.scale.y, {}}};
}

// Merges the box of the other half of the node. Bypasses the L1 cache, which does not see what other
// multiprocessors write.
__device__ void join_other_half(const Node& node, uint32_t side, DiskBox& box) {
  for (int axis = 0; axis < 3; ++axis) {
    const float* other = node.box[axis] + 2 * (1 - side);
    box.lower[axis] = std::fmin(box.lower[axis], __ldcg(other));
    box.upper[axis] = std::fmax(box.upper[axis], __ldcg(other + 1));
  }
}

// The thread of a disk climbs towards the root and sets boxes. It stops at a node whose other child is not
// ready yet; the thread of that child continues from there.
__global__ void __launch_bounds__(build_threads)
    make_disks_and_boxes(BuildInput input, const uint64_t* sorted_keys, const uint32_t* sorted_indices,
                         TreeView tree, Disk* disks) {
  const int64_t i = int64_t{blockIdx.x} * blockDim.x + threadIdx.x;
  if (i >= input.count) return;
  const uint32_t surfel = sorted_indices[i];
  DiskBox box{Vec3<float>(INFINITY), Vec3<float>(-INFINITY)};
  if (sorted_keys[i] != left_out) {
    disks[i] = make_disk(input, surfel);
    box = box_of(input, surfel);
  } else {
    disks[i] = {{Vec3<float>(0), -INFINITY, Vec3<float>(0), surfel}, {Vec3<float>(0), Vec3<float>(0), {}}};
  }
  for (uint32_t at = tree.disk_parent[i]; at != no_parent;) {
    const uint32_t node = at / 2, side = at % 2;
    for (int axis = 0; axis < 3; ++axis) {
      tree.nodes[node].box[axis][2 * side] = box.lower[axis];
      tree.nodes[node].box[axis][2 * side + 1] = box.upper[axis];
    }
    __threadfence();
    if (atomicAdd(tree.arrived + node, 1U) == 0) return;
    __threadfence();
    join_other_half(tree.nodes[node], side, box);
    at = tree.node_parent[node];
  }
}

void ensure_capacity(int64_t count, Tree& tree) {
  constexpr Device device = Device::cuda;
  const int64_t nodes = std::max<int64_t>(1, count - 1);
  tree.nodes.place(device).resize({nodes});
  tree.disks.place(device).resize({count});
  tree.keys.place(device).resize({count});
  tree.sorted_keys.place(device).resize({count});
  tree.indices.place(device).resize({count});
  tree.sorted_indices.place(device).resize({count});
  tree.disk_parent.place(device).resize({count});
  tree.node_parent.place(device).resize({nodes});
  tree.arrived.place(device).resize({nodes});
  tree.bounds.place(device).reset({6});
}

}  // namespace

void build(const PosedSurfels& surfels, const Options& options, Bvh& bvh) {
  if (!bvh.on_device) bvh.on_device = std::make_shared<Tree>();
  Tree& tree = *bvh.on_device;
  const int64_t count = surfels.count();
  require(count < int64_t{1} << 30, "a BVH on the device has fewer than 2^30 surfels", std::to_string(count));
  tree.surfels = count;
  ++tree.builds;
  if (count == 0) return;
  ensure_capacity(count, tree);
  const BuildInput input{surfels, count, {options.alpha_min, options.alpha_max, options.transmittance_min}};
  const TreeView view{tree.nodes.data(), tree.disk_parent.data(), tree.node_parent.data(),
                      tree.arrived.data()};
  const Grid grid{blocks_for(count, build_threads), build_threads};
  launch("trace: choose surfels", grid, choose_surfels, input, tree.keys.data(), tree.indices.data(),
         tree.bounds.data());
  launch("trace: surfel keys", grid, make_keys, surfels.position.data(), count, tree.bounds.data(),
         tree.keys.data());
  sort_pairs(count, 64, tree.keys.data(), tree.sorted_keys.data(), tree.indices.data(),
             tree.sorted_indices.data(), tree.sort_scratch);
  launch("trace: nodes", grid, make_nodes, Keys{tree.sorted_keys.data(), static_cast<int>(count)}, view);
  launch("trace: boxes", grid, make_disks_and_boxes, input, tree.sorted_keys.data(),
         tree.sorted_indices.data(), view, tree.disks.data());
}

}  // namespace traceflow::trace::cuda
