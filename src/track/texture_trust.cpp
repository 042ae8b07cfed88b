#include "track/texture_trust.h"

#include <algorithm>
#include <array>

namespace traceflow {

namespace {

// Colour, or tracks, are trusted if they undo less than this share of the rotations, once there were enough.
constexpr double most_taken_back = 0.15;
constexpr double enough_turned = 0.06;  // radians², Σ over keys: as much as one rotation of 14 degrees

// Rotations with a lower stiffness are left to texture. The middle one of balls is 0.2 to 0.4, of a kettle
// and a bust 2 to 4, and of a smooth cylinder 0.55.
constexpr double least_stiffness = 0.45;

// A ball is a mirror if its rotations by photographs differ from those of a mirror image by less than this
// share. For a textured ball, at rest or rotating, it is near 1. The mirror image must have rotated enough.
constexpr double most_unlike = 0.4;
constexpr double enough_of_mirror_image = 0.02;  // radians²

}  // namespace

TextureTrust TextureTrust::of(int64_t bodies) {
  return {Tensor<double>({bodies}), Tensor<double>({bodies}), Tensor<double>({bodies}),
          Tensor<double>({bodies, 3}), Tensor<double>({bodies, 2})};
}

bool TextureTrust::holds(const Tensor<double>& taken_back, int64_t body) const {
  return !turned.empty() && turned[body] > enough_turned && taken_back[body] < most_taken_back * turned[body];
}

bool TextureTrust::holds_texture(int64_t body) const {
  const bool is_ball = !stiffness.empty() && stiffness(body, 1) < least_stiffness * stiffness(body, 2);
  return holds_colour(body) && !is_ball;
}

bool TextureTrust::mirrors(int64_t body) const {
  return !mirror_image.empty() && mirror_image(body, 0) > enough_of_mirror_image &&
         mirror_image(body, 1) < most_unlike * mirror_image(body, 0);
}

void TextureTrust::add_stiffness(const std::vector<SymmetricEigen<3, double>>& now) {
  if (stiffness.empty() && !now.empty()) *this = of(static_cast<int64_t>(now.size()));
  for (size_t b = 0; b < now.size(); ++b) {
    if (!(now[b].values[2] > 0)) continue;  // not visible
    double* const sums = stiffness.row(static_cast<int64_t>(b));
    sums[0] += now[b].values[0];
    sums[1] += now[b].values[1];
    sums[2] += 1;
  }
}

void TextureTrust::add_turn(int64_t body, const Vec3<double>& of_mirror_image,
                            const Vec3<double>& by_photographs) {
  const Vec3<double> unlike = by_photographs - of_mirror_image;
  const double all = dot(of_mirror_image, of_mirror_image);
  mirror_image(body, 0) += all;
  mirror_image(body, 1) += std::min(all, dot(unlike, unlike));
}

LooseTurns TextureTrust::loose_turns(const std::vector<SymmetricEigen<3, double>>& now) const {
  LooseTurns loose;
  for (size_t b = 0; b < now.size(); ++b) {
    std::array<double, 3> sums{now[b].values[0], now[b].values[1], 1};
    const auto body = static_cast<int64_t>(b);
    if (!stiffness.empty() && stiffness(body, 2) > 0) std::copy_n(stiffness.row(body), 3, sums.begin());
    const bool is_loose = sums[0] < least_stiffness * sums[2], is_ball = sums[1] < least_stiffness * sums[2];
    const Vec3<double> axis = now[b].vectors[0];
    loose.push_back(is_ball ? Mat3<double>(1) : is_loose ? outerProduct(axis, axis) : Mat3<double>(0));
  }
  return loose;
}

LooseTurns TextureTrust::without_mirrors(LooseTurns loose) const {
  for (size_t b = 0; b < loose.size(); ++b) {
    if (mirrors(static_cast<int64_t>(b))) loose[b] = Mat3<double>(0);
  }
  return loose;
}

}  // namespace traceflow
