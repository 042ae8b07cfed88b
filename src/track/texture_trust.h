#pragma once

#include <cstdint>
#include <vector>

#include "base/tensor.h"
#include "math/symmetric_eigen.h"
#include "track/photo_alignment.h"

namespace traceflow {

// Whether what bodies look like tells how they turn; gathered over the times followed, for each of B bodies.
// Empty before. A texture turns with the body; a mirror image stays behind, so that the model's colours, and
// points that a program tracks, would take back a part of each turn. Where silhouettes and normals hardly
// tell a turn, as that of a ball, photographs and tracks are asked, unless the photographs turn as a mirror
// image does.
struct TextureTrust {
  Tensor<double> turned;                // B, Σ d·d, radians²: d the last turn, up to the key before
  Tensor<double> taken_back_by_colour;  // B, Σ −ω·d: ω what colour alone would add to the turn by normals
                                        // and silhouettes
  Tensor<double> taken_back_by_tracks;  // B, likewise
  Tensor<double> stiffness;  // B×3: Σ of the least and of the middle stiffness, and of how many times
  Tensor<double> mirror_image;  // B×2: Σ μ·μ and Σ min(|ω − μ|², μ·μ), radians²: μ a mirror image's turn
                                // (track/mirror_image.h), ω the turn that photographs alone tell

  // Of B bodies of which nothing is known.
  static TextureTrust of(int64_t bodies);
  // Whether the model's colours, and the capture's tracks, belong to the surface.
  bool holds_colour(int64_t body) const { return holds(taken_back_by_colour, body); }
  // The same, of a body whose shape tells how it turns: photographs of all its times can then be adjusted to
  // each other.
  bool holds_texture(int64_t body) const;
  bool holds_tracks(int64_t body) const { return holds(taken_back_by_tracks, body); }
  // Whether photographs show a mirror image on the body.
  bool mirrors(int64_t body) const;
  void add_stiffness(const std::vector<SymmetricEigen<3, double>>& now);
  void add_turn(int64_t body, const Vec3<double>& of_mirror_image, const Vec3<double>& by_photographs);
  // The turns of each body that only its texture can tell, by the mean stiffness and the axes now
  // (PoseSolver::turn_stiffness): none, those about the least stiff axis, or all. What looks the same however
  // it turns about two axes is a ball.
  LooseTurns loose_turns(const std::vector<SymmetricEigen<3, double>>& now) const;
  // The same, but none of bodies that mirror.
  LooseTurns without_mirrors(LooseTurns loose) const;

 private:
  bool holds(const Tensor<double>& taken_back, int64_t body) const;
};

}  // namespace traceflow
