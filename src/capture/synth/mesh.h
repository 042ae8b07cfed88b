#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "capture/synth/ray.h"

// A deformed triangle mesh: where a ray hits it, and which material point that is.
namespace traceflow::synth {

struct MeshHit {
  double distance = infinity;  // in units of the ray's direction
  int triangle = -1;           // -1: no hit
};

class Mesh {
 public:
  // Three vertex indices, counter-clockwise seen from outside.
  using Triangle = std::array<int32_t, 3>;

  // rest, deformed: the same vertices at rest and now, metres, finite. A degenerate triangle is never hit.
  Mesh(std::vector<Triangle> triangles, std::vector<Vector> rest, std::vector<Vector> deformed);

  // First triangle that the ray hits beyond `nearest`, from either side; borders are included.
  MeshHit hit(const Ray& ray, double nearest = 0) const;
  // The triangle's outward unit normal. It is flat, so that normals agree exactly with depths.
  Vector normal(int triangle) const;
  // Maps a point of a triangle from the deformed surface to the surface at rest and back. It keeps its
  // barycentric coordinates.
  Vector at_rest(int triangle, const Vector& deformed_point) const;
  Vector deformed(int triangle, const Vector& rest_point) const;
  // Radius of the sphere around the origin that contains the deformed surface.
  double bounding_radius() const { return bounding_radius_; }

 private:
  // A box around the triangles order_[first … first + count). If count is 0, it contains the next node and
  // node `first`.
  struct Node {
    Vector low;
    Vector high;
    int32_t first;
    int32_t count;
  };
  using Corners = std::array<Vector, 3>;

  Corners corners(const std::vector<Vector>& vertices, int triangle) const;
  void build(int32_t first, int32_t last, const std::vector<Vector>& centres);

  std::vector<Triangle> triangles_;
  std::vector<Vector> rest_;
  std::vector<Vector> deformed_;
  std::vector<int32_t> order_;
  std::vector<Node> nodes_;
  double bounding_radius_ = 0;
};

}  // namespace traceflow::synth
