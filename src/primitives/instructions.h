#pragma once

#include <array>
#include <string>
#include <string_view>

// The vector instructions that steps on the CPU use.
namespace traceflow {

// Each includes those before it; `automatic` is the best that the processor has.
enum class Instructions { automatic, sse4, avx2, avx512 };
constexpr std::array<std::string_view, 4> enum_names(Instructions) {
  return {"automatic", "sse4", "avx2", "avx512"};
}

// From now on uses no instructions beyond `most`, in our own steps and in oneDNN's products. Each level sums
// in another order, so runs on different processors have the same bytes only with the same limit. (The C
// library chooses its instructions itself.) avx512 is its common part, without bf16. Call it before any step
// has run. Throws InputError if the processor lacks `most`, InternalError if it is called too late.
void limit_instructions(Instructions most);

// The instructions in use, in words. Processors or limits with the same text give the same bytes.
std::string instructions_in_use();

}  // namespace traceflow
