#pragma once

#include <array>
#include <string>
#include <string_view>

// Which of the processor's vector instructions the CPU's steps use.
namespace traceflow {

// Each with those before it; `automatic` is the best that the processor has.
enum class Instructions { automatic, sse4, avx2, avx512 };
constexpr std::array<std::string_view, 4> enum_names(Instructions) {
  return {"automatic", "sse4", "avx2", "avx512"};
}

// Uses none beyond `most`, in our own steps and in oneDNN's products, from now on: sums are taken in another
// order by each, so that runs of the same bytes on unlike processors need the same limit. (What the C library
// computes, its own choice of instructions decides.) avx512 is its common part, without bf16. Call it before
// any step has run. Throws InputError where the processor lacks `most`, InternalError where it is too late.
void limit_instructions(Instructions most);

// Which of them are used, in words: processors, or limits, of which the same is said give the same bytes.
std::string instructions_in_use();

}  // namespace traceflow
