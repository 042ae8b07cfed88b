#include "primitives/instructions.h"

#include <hwy/targets.h>
#include <dnnl.hpp>
#include <string>

#include "base/error.h"

namespace traceflow {

namespace {

struct Level {
  int64_t target;  // of Highway; better targets have lower bits
  dnnl::cpu_isa isa;
};

Level level_of(Instructions instructions) {
  switch (instructions) {
    case Instructions::sse4:
      return {HWY_SSE4, dnnl::cpu_isa::sse41};
    case Instructions::avx2:
      return {HWY_AVX2, dnnl::cpu_isa::avx2};
    default:
      return {HWY_AVX3, dnnl::cpu_isa::avx512_core};
  }
}

struct IsaName {
  dnnl::cpu_isa isa;
  const char* name;
};
// Best first: each includes those after it.
constexpr IsaName isa_names[] = {{dnnl::cpu_isa::avx512_core_amx, "amx"},
                                 {dnnl::cpu_isa::avx512_core_bf16, "avx512 with bf16"},
                                 {dnnl::cpu_isa::avx512_core, "avx512"},
                                 {dnnl::cpu_isa::avx2, "avx2"},
                                 {dnnl::cpu_isa::sse41, "sse4"}};

const char* isa_in_use() {
  const auto isa = static_cast<unsigned>(dnnl::get_effective_cpu_isa());
  for (const IsaName& known : isa_names) {
    const auto needed = static_cast<unsigned>(known.isa);
    if ((isa & needed) == needed) return known.name;
  }
  return "none";
}

}  // namespace

void limit_instructions(Instructions most) {
  if (most == Instructions::automatic) return;
  const Level level = level_of(most);
  const std::string name(enum_names(most)[static_cast<size_t>(most)]);
  if ((hwy::SupportedTargets() & level.target) == 0) {
    throw InputError("--instructions", "", name, "instructions that this processor has", "use automatic");
  }
  hwy::DisableTargets(level.target - 1);
  require(dnnl::set_max_cpu_isa(level.isa) == dnnl::status::success,
          "instructions are limited before oneDNN is used", name);
}

std::string instructions_in_use() {
  const int64_t targets = hwy::SupportedTargets() & HWY_TARGETS;
  return std::string(hwy::TargetName(targets & -targets)) + " (oneDNN: " + isa_in_use() + ")";
}

}  // namespace traceflow
