#include "ops/trace/cpu/tree.h"

#include <algorithm>
#include <array>

#include "base/parallel.h"

// Builds top-down: cuts a range of items in two until it fits a leaf. A cut is the cheapest plane between
// bins of centres by the surface area heuristic. Minima, maxima and counts do not depend on the order of
// their terms, so several threads can bin blocks of a large range.
namespace traceflow::trace {

namespace {

constexpr int most_bins = 16;
constexpr int64_t parallel_grain = 1 << 13;
constexpr uint32_t job_items = 1 << 12;

struct Range {
  uint32_t begin = 0, end = 0;
  Box box;
  Box centres;  // of centre2()

  uint32_t count() const { return end - begin; }
};

struct Bins {
  std::array<std::array<Box, most_bins>, 3> box;
  std::array<std::array<uint32_t, most_bins>, 3> count{};
};

// The bin of a centre on all three axes.
struct Binning {
  Float4 offset, factor;
  int bins;

  Binning(const Box& centres, uint32_t items) : offset(centres.lower), bins(items < 128 ? 8 : most_bins) {
    const Float4 size = centres.upper - centres.lower;
    for (int axis = 0; axis < 3; ++axis) {
      const float f = static_cast<float>(bins) * 0.9999F / size[axis];
      factor[axis] = f > 0 && f < std::numeric_limits<float>::max() ? f : 0;
    }
    factor[3] = 0;
  }
  std::array<int, 3> operator()(const Box& box) const {
    const Float4 x = (box.centre2() - offset) * factor;
    return {bin(x[0]), bin(x[1]), bin(x[2])};
  }
  bool is_flat(int axis) const { return factor[axis] == 0; }

 private:
  int bin(float x) const { return std::min(static_cast<int>(x), bins - 1); }
};

struct Cut {
  int axis = -1;
  int bin = 0;  // items of lower bins go to the left
  float cost = std::numeric_limits<float>::max();
};

void fill_bins(const BoxItem* begin, const BoxItem* end, const Binning& binning, Bins& bins) {
  for (const BoxItem* item = begin; item != end; ++item) {
    const std::array<int, 3> b = binning(item->box);
    for (size_t axis = 0; axis < 3; ++axis) {
      const auto k = static_cast<size_t>(b[axis]);
      bins.box[axis][k].add(item->box);
      ++bins.count[axis][k];
    }
  }
}

void merge(const Bins& from, Bins& into) {
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t k = 0; k < most_bins; ++k) {
      into.box[axis][k].add(from.box[axis][k]);
      into.count[axis][k] += from.count[axis][k];
    }
  }
}

Bins fill_bins_parallel(const BoxItem* items, uint32_t count, const Binning& binning) {
  std::vector<Bins> partial((count + parallel_grain - 1) / parallel_grain);
  parallel_blocks("trace bin", count, parallel_grain, [&](int64_t begin, int64_t end) {
    fill_bins(items + begin, items + end, binning, partial[static_cast<size_t>(begin / parallel_grain)]);
  });
  for (size_t i = 1; i < partial.size(); ++i) merge(partial[i], partial[0]);
  return partial[0];
}

// Leaves are tested 16 surfels at a time, so the cost of a part is the number of leaves that it fills.
float part_cost(const Box& box, uint32_t count) {
  const uint32_t leaves = (count + bvh_width - 1) / bvh_width;
  return box.area() * static_cast<float>(leaves);
}

void best_on_axis(const Bins& bins, int axis, int bin_count, Cut& best) {
  const auto& box = bins.box[static_cast<size_t>(axis)];
  const auto& count = bins.count[static_cast<size_t>(axis)];
  std::array<float, most_bins> right_cost{};
  Box right;
  uint32_t right_count = 0;
  for (int k = bin_count - 1; k > 0; --k) {
    const auto i = static_cast<size_t>(k);
    right.add(box[i]);
    right_count += count[i];
    right_cost[i] = right_count ? part_cost(right, right_count) : -1;
  }
  Box left;
  uint32_t left_count = 0;
  for (int k = 1; k < bin_count; ++k) {
    const auto i = static_cast<size_t>(k);
    left.add(box[i - 1]);
    left_count += count[i - 1];
    if (left_count == 0 || right_cost[i] < 0) continue;
    const float cost = part_cost(left, left_count) + right_cost[i];
    if (cost < best.cost) best = {axis, k, cost};
  }
}

Cut choose_cut(const Bins& bins, const Binning& binning) {
  Cut best;
  for (int axis = 0; axis < 3; ++axis) {
    if (!binning.is_flat(axis)) best_on_axis(bins, axis, binning.bins, best);
  }
  return best;
}

void measure(const std::vector<BoxItem>& items, Range& range) {
  for (uint32_t i = range.begin; i < range.end; ++i) {
    range.box.add(items[i].box);
    range.centres.add_point(items[i].box.centre2());
  }
}

class Builder {
 public:
  explicit Builder(std::vector<BoxItem>& items) : items_(items) {}

  // A subtree to be built later. Its root replaces `node`.
  struct Job {
    uint32_t node;
    Range range;
    int depth;
  };

  // Adds the node over `range` and its descendants. If `jobs` is not null, it postpones subtrees of at most
  // job_items items to `jobs`.
  uint32_t add_node(const Range& range, int depth, std::vector<BinaryNode>& out, std::vector<Job>* jobs) {
    const auto index = static_cast<uint32_t>(out.size());
    out.push_back({range.box, range.begin, range.end, 0, 0});
    if (range.count() <= bvh_width) return index;
    if (jobs && range.count() <= job_items) {
      jobs->push_back({index, range, depth});
      return index;
    }
    const auto [left, right] = cut(range, depth);
    const uint32_t first = add_node(left, depth + 1, out, jobs);
    const uint32_t second = add_node(right, depth + 1, out, jobs);
    out[index].left = first;
    out[index].right = second;
    return index;
  }

 private:
  std::pair<Range, Range> cut(const Range& range, int depth) {
    if (depth < bvh_max_free_depth) {
      const Binning binning(range.centres, range.count());
      const Cut best = choose_cut(bin(range, binning), binning);
      if (best.axis >= 0) return partition(range, binning, best);
    }
    return halve(range);
  }

  Bins bin(const Range& range, const Binning& binning) const {
    const BoxItem* first = items_.data() + range.begin;
    if (range.count() > 2 * parallel_grain) return fill_bins_parallel(first, range.count(), binning);
    Bins bins;
    fill_bins(first, first + range.count(), binning, bins);
    return bins;
  }

  std::pair<Range, Range> partition(const Range& range, const Binning& binning, const Cut& best) {
    const auto axis = static_cast<size_t>(best.axis);
    Range left, right;
    left.begin = range.begin;
    right.end = range.end;
    uint32_t i = range.begin, j = range.end;
    const auto goes_left = [&](const Box& box) { return binning(box)[axis] < best.bin; };
    const auto take = [](Range& side, const Box& box) {
      side.box.add(box);
      side.centres.add_point(box.centre2());
    };
    while (true) {
      while (i < j && goes_left(items_[i].box)) take(left, items_[i++].box);
      while (i < j && !goes_left(items_[j - 1].box)) take(right, items_[--j].box);
      if (i >= j) break;
      std::swap(items_[i], items_[j - 1]);
    }
    left.end = right.begin = i;
    return {left, right};
  }

  // For items that no plane separates, or if the tree has become too deep.
  std::pair<Range, Range> halve(const Range& range) {
    const Float4 size = range.centres.upper - range.centres.lower;
    const int axis = size[0] >= size[1] && size[0] >= size[2] ? 0 : size[1] >= size[2] ? 1 : 2;
    const uint32_t middle = range.begin + range.count() / 2;
    const auto at = [&](uint32_t i) { return items_.begin() + i; };
    std::nth_element(at(range.begin), at(middle), at(range.end), [axis](const BoxItem& a, const BoxItem& b) {
      const float ca = a.box.centre2()[axis], cb = b.box.centre2()[axis];
      return ca < cb || (ca == cb && a.index < b.index);
    });
    Range left{range.begin, middle, {}, {}}, right{middle, range.end, {}, {}};
    measure(items_, left);
    measure(items_, right);
    return {left, right};
  }

  std::vector<BoxItem>& items_;
};

// Appends the subtrees. Each root replaces the node that was reserved for it.
void join(const std::vector<Builder::Job>& jobs, const std::vector<std::vector<BinaryNode>>& parts,
          std::vector<BinaryNode>& out) {
  for (size_t i = 0; i < jobs.size(); ++i) {
    const auto offset = static_cast<uint32_t>(out.size()) - 1;
    const auto moved = [offset](BinaryNode node) {
      if (node.left) node.left += offset;
      if (node.right) node.right += offset;
      return node;
    };
    out[jobs[i].node] = moved(parts[i][0]);
    for (size_t k = 1; k < parts[i].size(); ++k) out.push_back(moved(parts[i][k]));
  }
}

}  // namespace

std::vector<BinaryNode> build_binary_tree(std::vector<BoxItem>& items) {
  std::vector<BinaryNode> tree;
  if (items.empty()) return tree;
  Range all;
  all.end = static_cast<uint32_t>(items.size());
  measure(items, all);
  Builder builder(items);
  std::vector<Builder::Job> jobs;
  builder.add_node(all, 0, tree, &jobs);
  std::vector<std::vector<BinaryNode>> parts(jobs.size());
  parallel_for(
      "trace subtrees", static_cast<int64_t>(jobs.size()),
      [&](int64_t i) {
        const auto k = static_cast<size_t>(i);
        builder.add_node(jobs[k].range, jobs[k].depth, parts[k], nullptr);
      },
      1);
  join(jobs, parts, tree);
  return tree;
}

}  // namespace traceflow::trace
