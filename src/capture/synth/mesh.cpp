#include "capture/synth/mesh.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/error.h"

namespace traceflow::synth {

namespace {

constexpr int32_t leaf_size = 4;
// Halving 2^31 triangles needs no more levels.
constexpr int deepest = 32;
// Triangles extend past their borders by this fraction of their size, so that no ray passes between two.
constexpr double overlap = 1e-12;
// Sine of the smallest angle of a triangle, or between it and a ray, for which the hit is reliable.
constexpr double thinnest = 1e-12;

// Möller and Trumbore (1997). Comparisons are written so that NaN is a miss.
double distance_to_triangle(const std::array<Vector, 3>& corners, const Ray& ray) {
  const Vector edge_1 = corners[1] - corners[0];
  const Vector edge_2 = corners[2] - corners[0];
  const Vector p = cross(ray.direction, edge_2);
  const double determinant = dot(edge_1, p);
  const double largest2 = dot(edge_1, edge_1) * dot(edge_2, edge_2);
  if (!(determinant * determinant > thinnest * thinnest * largest2)) return infinity;
  const Vector from_corner = ray.origin - corners[0];
  const double u = dot(from_corner, p) / determinant;
  if (!(u >= -overlap && u <= 1 + overlap)) return infinity;
  const Vector q = cross(from_corner, edge_1);
  const double v = dot(ray.direction, q) / determinant;
  if (!(v >= -overlap && u + v <= 1 + overlap)) return infinity;
  const double t = dot(edge_2, q) / determinant;
  return std::isfinite(t) ? t : infinity;
}

// Whether the ray passes through the box between `nearest` and `farthest`. A ray along a face is inside.
bool enters(const Vector& low, const Vector& high, const Ray& ray, const Vector& inverse, double nearest,
            double farthest) {
  for (int axis = 0; axis < 3; ++axis) {
    if (ray.direction[axis] == 0) {
      if (!(ray.origin[axis] >= low[axis] && ray.origin[axis] <= high[axis])) return false;
      continue;
    }
    const double a = (low[axis] - ray.origin[axis]) * inverse[axis];
    const double b = (high[axis] - ray.origin[axis]) * inverse[axis];
    nearest = std::max(nearest, std::min(a, b));
    farthest = std::min(farthest, std::max(a, b));
  }
  return nearest <= farthest;
}

// The point of triangle `to` with the barycentric coordinates of `point` in triangle `from`.
Vector deformed_with(const std::array<Vector, 3>& from, const std::array<Vector, 3>& to,
                     const Vector& point) {
  const Vector edge_1 = from[1] - from[0];
  const Vector edge_2 = from[2] - from[0];
  const Vector normal = cross(edge_1, edge_2);
  const double area2 = dot(normal, normal);
  if (!(area2 > 0)) return to[0];
  const Vector offset = point - from[0];
  const double u = dot(cross(offset, edge_2), normal) / area2;
  const double v = dot(cross(edge_1, offset), normal) / area2;
  return to[0] + u * (to[1] - to[0]) + v * (to[2] - to[0]);
}

}  // namespace

Mesh::Mesh(std::vector<Triangle> triangles, std::vector<Vector> rest, std::vector<Vector> deformed)
    : triangles_(std::move(triangles)),
      rest_(std::move(rest)),
      deformed_(std::move(deformed)),
      order_(triangles_.size()) {
  require(rest_.size() == deformed_.size(), "a mesh has the same vertices at rest and deformed");
  for (size_t i = 0; i < rest_.size(); ++i) {
    require(is_finite(rest_[i]) && is_finite(deformed_[i]), "a mesh's vertices are finite");
    bounding_radius_ = std::max(bounding_radius_, length(deformed_[i]));
  }
  std::vector<Vector> centres(triangles_.size(), Vector(0));
  for (size_t i = 0; i < triangles_.size(); ++i) {
    for (const int32_t vertex : triangles_[i]) {
      require(vertex >= 0 && static_cast<size_t>(vertex) < rest_.size(), "a mesh's triangles have vertices");
      centres[i] += deformed_[static_cast<size_t>(vertex)] / 3.0;
    }
  }
  std::iota(order_.begin(), order_.end(), 0);
  if (!order_.empty()) build(0, static_cast<int32_t>(order_.size()), centres);
}

Mesh::Corners Mesh::corners(const std::vector<Vector>& vertices, int triangle) const {
  const Triangle& t = triangles_[static_cast<size_t>(triangle)];
  return {vertices[static_cast<size_t>(t[0])], vertices[static_cast<size_t>(t[1])],
          vertices[static_cast<size_t>(t[2])]};
}

// Splits the triangles order_[first … last) at the median of their centres along the longest side of the box
// around those centres, until few are left. Nodes are stored in depth-first order.
void Mesh::build(int32_t first, int32_t last, const std::vector<Vector>& centres) {
  Node node{Vector(infinity), Vector(-infinity), first, last - first};
  Vector low(infinity);
  Vector high(-infinity);
  for (int32_t i = first; i < last; ++i) {
    const int32_t triangle = order_[static_cast<size_t>(i)];
    for (const Vector& corner : corners(deformed_, triangle)) {
      node.low = glm::min(node.low, corner);
      node.high = glm::max(node.high, corner);
    }
    low = glm::min(low, centres[static_cast<size_t>(triangle)]);
    high = glm::max(high, centres[static_cast<size_t>(triangle)]);
  }
  // Rounding must not make a ray miss the box of a triangle that it hits at the border.
  node.low -= overlap * bounding_radius_;
  node.high += overlap * bounding_radius_;
  const size_t index = nodes_.size();
  nodes_.push_back(node);
  if (node.count <= leaf_size) return;

  const Vector size = high - low;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
  const int32_t middle = first + node.count / 2;
  const auto before = [&](int32_t a, int32_t b) {
    const double at_a = centres[static_cast<size_t>(a)][axis];
    const double at_b = centres[static_cast<size_t>(b)][axis];
    return at_a != at_b ? at_a < at_b : a < b;
  };
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last, before);
  build(first, middle, centres);
  nodes_[index].count = 0;
  nodes_[index].first = static_cast<int32_t>(nodes_.size());
  build(middle, last, centres);
}

MeshHit Mesh::hit(const Ray& ray, double nearest) const {
  MeshHit best;
  if (nodes_.empty()) return best;
  const Vector inverse = 1.0 / ray.direction;
  std::array<int32_t, deepest + 1> waiting{};
  int count = 0;
  waiting[static_cast<size_t>(count++)] = 0;
  while (count > 0) {
    const int32_t index = waiting[static_cast<size_t>(--count)];
    const Node& node = nodes_[static_cast<size_t>(index)];
    if (!enters(node.low, node.high, ray, inverse, nearest, best.distance)) continue;
    if (node.count == 0) {
      waiting[static_cast<size_t>(count++)] = node.first;
      waiting[static_cast<size_t>(count++)] = index + 1;
      continue;
    }
    for (int32_t i = node.first; i < node.first + node.count; ++i) {
      const int triangle = order_[static_cast<size_t>(i)];
      const double t = distance_to_triangle(corners(deformed_, triangle), ray);
      if (t > nearest && t < best.distance) best = {t, triangle};
    }
  }
  return best;
}

Vector Mesh::normal(int triangle) const {
  const Corners c = corners(deformed_, triangle);
  return normalize(cross(c[1] - c[0], c[2] - c[0]));
}

Vector Mesh::at_rest(int triangle, const Vector& deformed_point) const {
  return deformed_with(corners(deformed_, triangle), corners(rest_, triangle), deformed_point);
}

Vector Mesh::deformed(int triangle, const Vector& rest_point) const {
  return deformed_with(corners(rest_, triangle), corners(deformed_, triangle), rest_point);
}

}  // namespace traceflow::synth
