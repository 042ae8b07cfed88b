#include "mesh/marching_cubes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/options.h"
#include "base/parallel.h"

namespace traceflow::mesh {

namespace {

// Corner c of a cell is at the bits of c: x is bit 0, y bit 1, z bit 2. The edge from corner c along an axis,
// whose bit is not set in c, has the code 3·c + axis.
int edge_between(int corner, int other) {
  const int difference = corner ^ other;
  return 3 * std::min(corner, other) + (difference == 1 ? 0 : difference == 2 ? 1 : 2);
}

// The triangles of a cell, as codes of edges, three for each, for every set of corners inside the surface
// (bit c: corner c).
using CellTriangles = std::array<std::vector<uint8_t>, 256>;

// Whether two edges of a cell are on one of its faces.
bool share_face(int edge, int other) {
  for (int axis = 0; axis < 3; ++axis) {
    const bool same_side = ((edge / 3) >> axis & 1) == ((other / 3) >> axis & 1);
    if (axis != edge % 3 && axis != other % 3 && same_side) return true;
  }
  return false;
}

// Cuts a loop of edges into triangles. No cut is within a face of the cell, where the next cell could have
// the same: then four triangles would meet at it.
void cut_loop(std::vector<int> loop, std::vector<uint8_t>& triangles) {
  const auto at = [&](size_t i) { return loop[i % loop.size()]; };
  while (loop.size() >= 3) {
    size_t ear = 0;
    for (size_t i = 0; i < loop.size() && loop.size() > 3; ++i) {
      if (share_face(at(i), at(i + 2))) continue;
      ear = i;
      break;
    }
    for (const size_t i : {ear, ear + 1, ear + 2}) triangles.push_back(static_cast<uint8_t>(at(i)));
    loop.erase(loop.begin() + static_cast<std::ptrdiff_t>((ear + 1) % loop.size()));
  }
}

// Each face of the cell separates every run of inside corners along its border from the rest by one segment.
// The two cells of a face see the same four corners and so the same segments: the surface has no cracks.
// Segments join to loops, which are cut into triangles.
std::vector<uint8_t> triangles_of(int inside) {
  std::array<int, 24> next{};
  next.fill(-1);
  for (int axis = 0; axis < 3; ++axis) {
    const int b = 1 << ((axis + 1) % 3), c = 1 << ((axis + 2) % 3);
    for (int side = 0; side < 2; ++side) {
      // Counter-clockwise, seen from outside the cell.
      std::array<int, 4> corner = {0, b, b | c, c};
      if (side == 0) std::reverse(corner.begin(), corner.end());
      for (int& k : corner) k |= side << axis;
      const auto at = [&](int i) { return corner[static_cast<size_t>(i % 4)]; };
      const auto is_inside = [&](int i) { return (inside >> at(i) & 1) != 0; };
      for (int first = 0; first < 4; ++first) {
        if (!is_inside(first) || is_inside(first + 3)) continue;
        int last = first;
        while (is_inside(last + 1)) ++last;
        next[static_cast<size_t>(edge_between(at(first + 3), at(first)))] =
            edge_between(at(last), at(last + 1));
      }
    }
  }
  std::vector<uint8_t> triangles;
  for (size_t start = 0; start < next.size(); ++start) {
    std::vector<int> loop;
    for (int edge = static_cast<int>(start), following; (following = next[static_cast<size_t>(edge)]) >= 0;) {
      loop.push_back(edge);
      next[static_cast<size_t>(edge)] = -1;
      edge = following;
    }
    cut_loop(std::move(loop), triangles);
  }
  return triangles;
}

const CellTriangles& cell_triangles() {
  static const CellTriangles table = [] {
    CellTriangles all;
    for (int inside = 0; inside < 256; ++inside) all[static_cast<size_t>(inside)] = triangles_of(inside);
    return all;
  }();
  return table;
}

// The distances in a block and around it: from one voxel before it, for gradients, to two after.
class Distances {
 public:
  explicit Distances(const Neighbourhood& around) {
    for (int z = -1; z < side - 1; ++z) {
      for (int y = -1; y < side - 1; ++y) {
        for (int x = -1; x < side - 1; ++x) {
          const Voxel voxel = around.at(x, y, z);
          known_[place_of(x, y, z)] = voxel.known();
          value_[place_of(x, y, z)] = voxel.known() ? voxel.distance() : 0;
        }
      }
    }
  }
  bool known(const Vec3<int>& p) const { return known_[place_of(p.x, p.y, p.z)]; }
  float operator[](const Vec3<int>& p) const { return value_[place_of(p.x, p.y, p.z)]; }

  // Whether the surface crosses the edge from p to q.
  bool crosses(const Vec3<int>& p, const Vec3<int>& q) const {
    return known(p) && known(q) && ((*this)[p] < 0) != ((*this)[q] < 0) &&
           std::fabs((*this)[p] - (*this)[q]) < 1;
  }
  // From observed neighbours; p must be observed.
  Vec3<float> gradient(const Vec3<int>& p) const {
    Vec3<float> result(0);
    for (int axis = 0; axis < 3; ++axis) {
      Vec3<int> before = p, after = p;
      --before[axis];
      ++after[axis];
      if (!known(before)) before = p;
      if (!known(after)) after = p;
      const auto steps = static_cast<float>(after[axis] - before[axis]);
      if (steps > 0) result[axis] = ((*this)[after] - (*this)[before]) / steps;
    }
    return result;
  }

 private:
  static constexpr int side = block_side + 3;
  static size_t place_of(int x, int y, int z) {
    return static_cast<size_t>(((z + 1) * side + y + 1) * side + x + 1);
  }
  std::array<bool, side * side * side> known_{};
  std::array<float, side * side * side> value_{};
};

Vec3<int> corner_of(const Vec3<int>& cell, int corner) {
  return cell + Vec3<int>(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
}
Vec3<int> along(Vec3<int> p, int axis) {
  ++p[axis];
  return p;
}

template <class F>
void for_each_voxel(F&& f) {
  for (int z = 0; z < block_side; ++z) {
    for (int y = 0; y < block_side; ++y) {
      for (int x = 0; x < block_side; ++x) f(Vec3<int>(x, y, z));
    }
  }
}

// The surface of one block: the vertices on edges that begin at its voxels, and the triangles of the cells
// that do.
struct Part {
  std::vector<int32_t> edge;  // ascending: 3·Block::index + axis of each vertex
  std::vector<Vec3<float>> vertex, normal, colour;
  int64_t first_vertex = 0;
  std::vector<int32_t> triangles;
};

// The colour between two voxels, of which one may be too far from all observed surfaces to have one.
Vec3<float> colour_between(const Voxel& a, const Voxel& b, float t) {
  const auto weight = [](const Voxel& v) {
    return v.block->colour_weight[static_cast<size_t>(v.index)] > 0 ? 1.0F : 0.0F;
  };
  const auto colour = [](const Voxel& v) { return load3<float>(v.block->colour.data() + 3 * v.index); };
  const float of_a = (1 - t) * weight(a), of_b = t * weight(b);
  const float sum = of_a + of_b;
  if (!(sum > 0)) return Vec3<float>(0);
  return glm::clamp((of_a * colour(a) + of_b * colour(b)) / sum, 0.0F, 1.0F);
}

void find_vertices(const Neighbourhood& around, const Block& block, float voxel, Part& part) {
  const Distances distances(around);
  for_each_voxel([&](const Vec3<int>& p) {
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3<int> q = along(p, axis);
      if (!distances.crosses(p, q)) continue;
      // Not at the very ends: where a voxel is on the surface, several vertices would be one point, and their
      // triangles would have no area.
      const float t = std::clamp(distances[p] / (distances[p] - distances[q]), 0.001F, 0.999F);
      const Vec3<float> begin(block.place * block_side + p);
      Vec3<float> at = begin;
      at[axis] += t;
      Vec3<float> normal = (1 - t) * distances.gradient(p) + t * distances.gradient(q);
      const float length = glm::length(normal);
      if (length > 0) {
        normal /= length;
      } else {
        normal[axis] = distances[q] > distances[p] ? 1.0F : -1.0F;
      }
      part.edge.push_back(3 * Block::index(p.x, p.y, p.z) + axis);
      part.vertex.push_back(voxel * at);
      part.normal.push_back(normal);
      part.colour.push_back(colour_between(around.at(p.x, p.y, p.z), around.at(q.x, q.y, q.z), t));
    }
  });
}

// The corners inside the surface, as bits; 0 if the cell has no triangles.
int inside_corners(const Distances& distances, const Vec3<int>& cell) {
  int inside = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3<int> p = corner_of(cell, corner);
    if (!distances.known(p)) return 0;
    if (distances[p] < 0) inside |= 1 << corner;
  }
  return inside;
}

void find_triangles(const Neighbourhood& around, const std::vector<Part>& parts, Part& part) {
  const Distances distances(around);
  // The vertex on the edge that begins at p, which may belong to the next block; -1 if there is none.
  const auto vertex_on = [&](const Vec3<int>& p, int axis) {
    const Part& owner = parts[static_cast<size_t>(around.block_at(p.x, p.y, p.z))];
    const Voxel voxel = around.at(p.x, p.y, p.z);
    const int32_t edge = 3 * voxel.index + axis;
    const auto found = std::ranges::lower_bound(owner.edge, edge);
    if (found == owner.edge.end() || *found != edge) return int64_t{-1};
    return owner.first_vertex + (found - owner.edge.begin());
  };
  for_each_voxel([&](const Vec3<int>& cell) {
    const int inside = inside_corners(distances, cell);
    const std::vector<uint8_t>& edges = cell_triangles()[static_cast<size_t>(inside)];
    const size_t begin = part.triangles.size();
    for (const uint8_t edge : edges) {
      const int64_t vertex = vertex_on(corner_of(cell, edge / 3), edge % 3);
      if (vertex < 0) {
        part.triangles.resize(begin);
        return;
      }
      part.triangles.push_back(static_cast<int32_t>(vertex));
    }
  });
}

void append(const std::vector<Vec3<float>>& from, int64_t first, Tensor<float>& to) {
  for (size_t i = 0; i < from.size(); ++i) store3(to.row(first + static_cast<int64_t>(i)), from[i]);
}

}  // namespace

TriangleMesh zero_surface(const BlockGrid& grid, float voxel) {
  const std::vector<int32_t> order = grid.by_key();
  // By the number of the block, and visited in `order`.
  std::vector<Part> parts(static_cast<size_t>(grid.count()));
  const auto for_each_block = [&](const char* description, auto&& f) {
    parallel_for(
        description, grid.count(),
        [&](int64_t i) { f(Neighbourhood(grid, grid[i]), grid[i], parts[static_cast<size_t>(i)]); }, 16);
  };
  for_each_block("mesh: vertices", [&](const Neighbourhood& around, const Block& block, Part& part) {
    find_vertices(around, block, voxel, part);
  });
  int64_t vertices = 0;
  for (const int32_t i : order) {
    parts[static_cast<size_t>(i)].first_vertex = vertices;
    vertices += static_cast<int64_t>(parts[static_cast<size_t>(i)].vertex.size());
  }
  check_option(vertices <= std::numeric_limits<int32_t>::max(), "mesh.voxel", voxel,
               "a size that gives less than 2,147,483,648 vertices");
  for_each_block("mesh: triangles", [&](const Neighbourhood& around, const Block&, Part& part) {
    find_triangles(around, parts, part);
  });

  int64_t indices = 0;
  for (const Part& part : parts) indices += static_cast<int64_t>(part.triangles.size());
  TriangleMesh mesh;
  for (Tensor<float>* tensor : {&mesh.vertices, &mesh.normals, &mesh.colours}) tensor->resize({vertices, 3});
  mesh.triangles.resize({indices / 3, 3});
  int32_t* out = mesh.triangles.data();
  for (const int32_t i : order) {
    const Part& part = parts[static_cast<size_t>(i)];
    append(part.vertex, part.first_vertex, mesh.vertices);
    append(part.normal, part.first_vertex, mesh.normals);
    append(part.colour, part.first_vertex, mesh.colours);
    out = std::ranges::copy(part.triangles, out).out;
  }
  return mesh;
}

}  // namespace traceflow::mesh
