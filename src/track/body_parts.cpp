#include "track/body_parts.h"

#include <algorithm>
#include <cmath>

#include "scene/neighbours.h"
#include "track/body_centre.h"

namespace traceflow {

namespace {

constexpr int linked_neighbours = 16;
constexpr float apart = 4;  // median distances between neighbours
// Smaller groups are noise.
constexpr size_t least_in_group = 24;
constexpr double least_share = 0.05;

Tensor<float> places_of(const Surfels& main, const std::vector<int64_t>& rows) {
  Tensor<float> places({static_cast<int64_t>(rows.size()), 3});
  for (size_t k = 0; k < rows.size(); ++k)
    std::copy_n(main.position.row(rows[k]), 3, places.row(static_cast<int64_t>(k)));
  return places;
}

// The connected components of points. Each point is linked to its nearest neighbours within a maximum
// distance.
std::vector<std::vector<int64_t>> linked_groups(const Tensor<float>& places) {
  const int64_t count = places.dim(0);
  const Neighbours near = nearest_neighbours(places, linked_neighbours);
  std::vector<float> nearest;
  for (int64_t i = 0; i < count; ++i) nearest.push_back(near.distance2(i, 0));
  const auto middle = nearest.begin() + static_cast<std::ptrdiff_t>(nearest.size() / 2);
  std::nth_element(nearest.begin(), middle, nearest.end());
  const float most = apart * apart * *middle;
  std::vector<std::vector<int64_t>> links(static_cast<size_t>(count));
  for (int64_t i = 0; i < count; ++i) {
    for (int k = 0; k < linked_neighbours; ++k) {
      const int32_t other = near.index(i, k);
      if (other < 0 || near.distance2(i, k) > most) continue;
      links[static_cast<size_t>(i)].push_back(other);
      links[static_cast<size_t>(other)].push_back(i);
    }
  }
  std::vector<std::vector<int64_t>> groups;
  std::vector<char> visited(static_cast<size_t>(count));
  for (int64_t start = 0; start < count; ++start) {
    if (visited[static_cast<size_t>(start)] != 0) continue;
    std::vector<int64_t>& group = groups.emplace_back(1, start);
    visited[static_cast<size_t>(start)] = 1;
    for (size_t k = 0; k < group.size(); ++k) {
      for (const int64_t other : links[static_cast<size_t>(group[k])]) {
        char& was = visited[static_cast<size_t>(other)];
        if (was == 0) group.push_back(other);
        was = 1;
      }
    }
  }
  return groups;
}

Vec3<double> middle_of(const Tensor<float>& places) {
  Vec3<double> sum(0);
  for (int64_t i = 0; i < places.dim(0); ++i) sum += load3<double>(places.row(i));
  return sum / static_cast<double>(places.dim(0));
}

}  // namespace

std::vector<std::vector<int64_t>> separate_parts(const Surfels& main, int64_t points, int32_t body) {
  std::vector<int64_t> rows, others;
  for (int64_t i = 0; i < main.count(); ++i) {
    if (main.body[i] == body) (i < points ? rows : others).push_back(i);
  }
  if (rows.size() < 2 * least_in_group) return {};
  std::vector<std::vector<int64_t>> parts;
  for (const std::vector<int64_t>& group : linked_groups(places_of(main, rows))) {
    const bool is_part = group.size() >= least_in_group &&
                         static_cast<double>(group.size()) >= least_share * static_cast<double>(rows.size());
    std::vector<int64_t> chosen;
    chosen.reserve(group.size());
    for (const int64_t k : group) chosen.push_back(rows[static_cast<size_t>(k)]);
    if (is_part)
      parts.push_back(std::move(chosen));
    else
      others.insert(others.end(), chosen.begin(), chosen.end());
  }
  if (parts.size() < 2) return {};
  std::stable_sort(parts.begin(), parts.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  std::vector<int64_t> grouped;
  std::vector<size_t> part_of;
  for (size_t p = 0; p < parts.size(); ++p) {
    grouped.insert(grouped.end(), parts[p].begin(), parts[p].end());
    part_of.insert(part_of.end(), parts[p].size(), p);
  }
  std::sort(others.begin(), others.end());
  const Tensor<int32_t> nearest = nearest_of(places_of(main, grouped), places_of(main, others));
  for (size_t k = 0; k < others.size(); ++k)
    parts[part_of[static_cast<size_t>(nearest[static_cast<int64_t>(k)])]].push_back(others[k]);
  return parts;
}

Motion with_part(const Motion& motion, int32_t body, const std::vector<int64_t>& part, Surfels& main) {
  const int64_t added = motion.bodies(), keys = motion.keys();
  for (const int64_t row : part) main.body[row] = static_cast<int32_t>(added);
  Tensor<float> centre({added + 1, 3});
  std::copy_n(motion.centre.data(), motion.centre.size(), centre.data());
  std::copy_n(motion.centre.row(body), 3, centre.row(added));
  Motion result = still_motion(centre, motion.time);
  std::copy_n(motion.rotation.data(), motion.rotation.size(), result.rotation.data());
  std::copy_n(motion.shift.data(), motion.shift.size(), result.shift.data());
  for (int64_t key = 0; key < keys; ++key) {
    std::copy_n(&motion.rotation(body, key, 0), 4, &result.rotation(added, key, 0));
    std::copy_n(&motion.shift(body, key, 0), 3, &result.shift(added, key, 0));
  }
  move_centre(static_cast<int32_t>(added), middle_of(places_of(main, part)), result);
  return result;
}

}  // namespace traceflow
