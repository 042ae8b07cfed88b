#pragma once

#include "ops/trace/trace.h"

// The tracer on the CPU. The contract is that of trace.h.
namespace traceflow::trace::cpu {

void build(const PosedSurfels& surfels, const Options& options, Bvh& bvh);
int64_t blended_hits(const Saved& saved);
void forward(const PosedSurfels& surfels, const Bvh& bvh, const Rays& rays, const Options& options,
             Output& output, Saved* saved);
void backward(const PosedSurfels& surfels, const Rays& rays, const Options& options, const Saved& saved,
              const OutputGradient& grad_output, InputGradient& gradient);

}  // namespace traceflow::trace::cpu
