#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace traceflow {

// A trained field of a surfel (method §1.1).
struct SurfelField {
  std::string_view name;  // of the member, in checkpoints and in messages
  int64_t width;          // numbers per surfel; 0 for the harmonics, which have 3 (degree + 1)²
  // Properties of a 2DGS .ply. The harmonics also have f_rest_0, f_rest_1, …
  std::array<std::string_view, 4> ply;
  bool is_optional = false;  // sets may lack it: the environment has neither tint nor roughness
};

// Calls f(field, set.position, …) for each field, with that member of all sets. This is the only list of a
// surfel's fields; copies, conversions, checkpoints, .ply files and the optimiser's moments use it.
template <class F, class... Sets>
void for_each_field(F&& f, Sets&... sets) {
  f(SurfelField{"position", 3, {"x", "y", "z"}}, sets.position...);
  f(SurfelField{"log_scale", 2, {"scale_0", "scale_1"}}, sets.log_scale...);
  f(SurfelField{"rotation", 4, {"rot_0", "rot_1", "rot_2", "rot_3"}}, sets.rotation...);
  f(SurfelField{"opacity_logit", 1, {"opacity"}}, sets.opacity_logit...);
  f(SurfelField{"sh", 0, {"f_dc_0", "f_dc_1", "f_dc_2"}}, sets.sh...);
  f(SurfelField{"tint_logit", 1, {"tint"}, true}, sets.tint_logit...);
  f(SurfelField{"roughness_logit", 1, {"roughness"}, true}, sets.roughness_logit...);
}

}  // namespace traceflow
