#include "capture/synth/texture.h"

#include <cmath>
#include <cstdint>

#include "capture/synth/sampler.h"

namespace traceflow::synth {

namespace {

double lattice_value(int64_t x, int64_t y) {
  return unit_from_bits(
      mix_bits(static_cast<uint64_t>(x) * 0x9E3779B97F4A7C15ULL + static_cast<uint64_t>(y)));
}

// Value noise in [0, 1] on the integer lattice.
double smooth_noise(double x, double y) {
  const double floor_x = std::floor(x);
  const double floor_y = std::floor(y);
  const auto i = static_cast<int64_t>(floor_x);
  const auto j = static_cast<int64_t>(floor_y);
  const double fx = x - floor_x;
  const double fy = y - floor_y;
  const double wx = fx * fx * (3 - 2 * fx);
  const double wy = fy * fy * (3 - 2 * fy);
  return std::lerp(std::lerp(lattice_value(i, j), lattice_value(i + 1, j), wx),
                   std::lerp(lattice_value(i, j + 1), lattice_value(i + 1, j + 1), wx), wy);
}

double grain_at(const Vec2<double>& p) {
  return 0.65 * smooth_noise(p.x, p.y) + 0.35 * smooth_noise(2.7 * p.x + 17, 2.7 * p.y + 31);
}

bool is_odd(double cell) { return std::fmod(cell, 2.0) != 0; }

// Mortar lines are a tenth of a brick's height wide. Every second row is shifted by half a brick.
bool is_mortar(const Vec2<double>& p) {
  const double row = std::floor(p.y);
  const double x = p.x + (is_odd(row) ? 0.5 : 0.0);
  return p.y - row < 0.12 || x - std::floor(x) < 0.06;
}

bool shows_second(Pattern pattern, const Vec2<double>& p) {
  switch (pattern) {
    case Pattern::plain:
    case Pattern::patches:
      return false;
    case Pattern::checker:
      return is_odd(std::floor(p.x) + std::floor(p.y));
    case Pattern::stripes:
      return is_odd(std::floor(p.x + p.y));
    case Pattern::bricks:
      return is_mortar(p);
  }
  return false;
}

uint64_t cell_bits(const Vec3<int64_t>& cell) {
  uint64_t bits = 0;
  for (int axis = 0; axis < 3; ++axis) bits = combine_bits(bits, static_cast<uint64_t>(cell[axis]));
  return bits;
}

// Three numbers in [0, 1) from one 64-bit word.
Vector three_units(uint64_t bits) {
  return {unit_from_bits(bits), unit_from_bits(mix_bits(bits)), unit_from_bits(mix_bits(mix_bits(bits)))};
}

// The random word of the irregular cell that contains p. Each cube of the integer lattice has one cell centre
// at a random position; p belongs to the nearest centre.
uint64_t patch_bits(const Vector& p) {
  const Vec3<int64_t> home(glm::floor(p));
  double nearest = infinity;
  uint64_t found = 0;
  for (int64_t i = 0; i < 27; ++i) {
    const Vec3<int64_t> cell = home + Vec3<int64_t>(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    const uint64_t bits = cell_bits(cell);
    const Vector to_centre = Vector(cell) + three_units(bits) - p;
    if (dot(to_centre, to_centre) < nearest) {
      nearest = dot(to_centre, to_centre);
      found = bits;
    }
  }
  return found;
}

Vector patch_colour(const Texture& texture, const Vector& rest) {
  const uint64_t patch = patch_bits(texture.frequency.x * rest);
  const uint64_t speck = patch_bits(texture.grain_frequency * rest);
  const Vector colour = glm::mix(texture.first, texture.second, three_units(mix_bits(~patch)));
  return colour * (1 - texture.grain * unit_from_bits(mix_bits(~speck)));
}

}  // namespace

Vector colour_at(const Texture& texture, const Vec2<double>& uv, const Vector& rest) {
  if (texture.pattern == Pattern::patches) return patch_colour(texture, rest);
  const Vector colour =
      shows_second(texture.pattern, uv * texture.frequency) ? texture.second : texture.first;
  if (texture.grain == 0) return colour;
  return colour * (1 - texture.grain * grain_at(uv * texture.grain_frequency));
}

}  // namespace traceflow::synth
