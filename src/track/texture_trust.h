#pragma once

#include <cstdint>
#include <vector>

#include "base/tensor.h"
#include "math/symmetric_eigen.h"
#include "track/photo_alignment.h"

namespace traceflow {

// Statistics over the tracked keys, for each of B bodies, of whether appearance shows rotations. Empty at
// first. A texture rotates with the body. A mirror image stays behind, so the model's colours and tracked
// points would undo part of each rotation. If silhouettes and normals hardly constrain a rotation, as for a
// ball, photographs and tracks determine it, unless the photographs rotate like a mirror image.
struct TextureTrust {
  Tensor<double> turned;                // B, Σ d·d, radians²: d the last rotation, up to the previous key
  Tensor<double> taken_back_by_colour;  // B, Σ −ω·d: ω the rotation that colour alone would add to that by
                                        // normals and silhouettes
  Tensor<double> taken_back_by_tracks;  // B, likewise
  Tensor<double> stiffness;  // B×3: sums of the lowest and of the middle stiffness, and their count
  Tensor<double> mirror_image;  // B×2: Σ μ·μ and Σ min(|ω − μ|², μ·μ), radians²: μ the rotation of a mirror
                                // image (track/mirror_image.h), ω that by photographs alone

  // Empty statistics of B bodies.
  static TextureTrust of(int64_t bodies);
  // Whether the model's colours, and the capture's tracks, rotate with the surface.
  bool holds_colour(int64_t body) const { return holds(taken_back_by_colour, body); }
  // Likewise, and whether the body's shape shows its rotations. Then the photographs of all keys can be
  // adjusted to each other.
  bool holds_texture(int64_t body) const;
  bool holds_tracks(int64_t body) const { return holds(taken_back_by_tracks, body); }
  // Whether photographs show a mirror image on the body.
  bool mirrors(int64_t body) const;
  void add_stiffness(const std::vector<SymmetricEigen<3, double>>& now);
  void add_turn(int64_t body, const Vec3<double>& of_mirror_image, const Vec3<double>& by_photographs);
  // The rotations of each body that only its texture shows, from the mean stiffness and the present axes
  // (PoseSolver::turn_stiffness): none, those about the least stiff axis, or all. A body with two such axes
  // is a ball.
  LooseTurns loose_turns(const std::vector<SymmetricEigen<3, double>>& now) const;
  // The same, but none for bodies that mirror.
  LooseTurns without_mirrors(LooseTurns loose) const;

 private:
  bool holds(const Tensor<double>& taken_back, int64_t body) const;
};

}  // namespace traceflow
