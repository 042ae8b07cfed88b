#include "math/spherical_harmonics.h"
#include "ops/trace/cuda/forward.h"
#include "primitives/sort.h"

// Sums the contributions of hits to their surfels in a fixed order. Hits are sorted by surfel, then by ray. A
// run is a sequence of hits of one surfel. A warp sums the runs of a span of hits. A run inside the span is
// complete. The runs at the two ends become rows of a shorter list, which is processed in the same way until
// one span holds it all.
namespace traceflow::trace::cuda {

using namespace traceflow::cuda;

namespace {

constexpr int sum_threads = 128;
constexpr int64_t span_rows = 64;
constexpr int row_values = 2 * warp_lanes;  // dL/dsh, then the contributions, then padding

struct Totals {
  SurfelSums* sums;
  float* grad_sh;
  int numbers;       // in dL/dsh
  uint32_t surfels;  // rows with higher numbers are heads of passes
};

// The sorted hits.
struct HitRows {
  const uint64_t* keys;
  const uint32_t* places;
  const HitParts* parts;
  const float* basis;
  int ray_bits, numbers;

  __device__ uint32_t surfel(int64_t i) const { return static_cast<uint32_t>(keys[i] >> ray_bits); }
  __device__ float value(int64_t i, int v) const {
    const HitParts& hit = parts[places[i]];
    if (v < numbers) return basis[16 * int64_t{hit.ray} + v / 3] * hit.passed[v % 3];
    return v < numbers + static_cast<int>(part::count) ? hit.part[v - numbers] : 0;
  }
};

// The ends of spans.
struct EndRows {
  const uint32_t* surfels;
  const float* values;

  __device__ uint32_t surfel(int64_t i) const { return surfels[i]; }
  __device__ float value(int64_t i, int v) const { return values[row_values * i + v]; }
};

// Output: two rows for each span.
struct Ends {
  uint32_t* surfels;
  float* values;

  __device__ void write(int64_t i, uint32_t surfel, const float (&sum)[2]) const {
    const int lane = static_cast<int>(threadIdx.x) % warp_lanes;
    if (lane == 0) surfels[i] = surfel;
    values[row_values * i + lane] = sum[0];
    values[row_values * i + lane + warp_lanes] = sum[1];
  }
};

__device__ void add_total(const Totals& totals, uint32_t surfel, const float (&sum)[2]) {
  if (surfel >= totals.surfels) return;
  for (int half = 0; half < 2; ++half) {
    const int v = static_cast<int>(threadIdx.x) % warp_lanes + half * warp_lanes;
    if (v < totals.numbers) {
      totals.grad_sh[int64_t{totals.numbers} * surfel + v] += sum[half];
    } else if (v < totals.numbers + static_cast<int>(part::count)) {
      totals.sums[surfel].value[v - totals.numbers] += sum[half];
    }
  }
}

template <class Rows>
__global__ void __launch_bounds__(sum_threads) add_runs(Rows rows, int64_t count, Totals totals, Ends ends) {
  const int64_t span = (int64_t{blockIdx.x} * blockDim.x + threadIdx.x) / warp_lanes;
  const int64_t begin = span * span_rows;
  if (begin >= count) return;
  const int64_t end = begin + span_rows < count ? begin + span_rows : count;
  const int lane = static_cast<int>(threadIdx.x) % warp_lanes;
  const bool last_list = count <= span_rows;
  uint32_t surfel = rows.surfel(begin);
  float sum[2] = {};
  bool first_run = !last_list;
  for (int64_t i = begin; i < end; ++i) {
    const uint32_t next = rows.surfel(i);
    if (next != surfel) {
      if (first_run) {
        ends.write(2 * span, surfel, sum);
      } else {
        add_total(totals, surfel, sum);
      }
      first_run = false;
      surfel = next;
      sum[0] = sum[1] = 0;
    }
    if (surfel >= totals.surfels) continue;
    sum[0] += rows.value(i, lane);
    sum[1] += rows.value(i, lane + warp_lanes);
  }
  if (last_list) {
    add_total(totals, surfel, sum);
    return;
  }
  // If one run fills the whole span, the second row is zero, so that rows of equal surfels stay adjacent.
  if (first_run) {
    ends.write(2 * span, surfel, sum);
    sum[0] = sum[1] = 0;
  }
  ends.write(2 * span + 1, surfel, sum);
}

}  // namespace

void sum_in_order(int degree, int64_t records, uint32_t surfels, int ray_bits, SavedHits& hits,
                  SurfelSums* sums, float* grad_sh) {
  if (records == 0) return;
  const int numbers = 3 * sh_coefficients(degree);
  const Totals totals{sums, grad_sh, numbers, surfels};
  hits.sorted_keys.place(Device::cuda).resize({records});
  hits.sorted_places.place(Device::cuda).resize({records});
  int bits = ray_bits;
  while (bits < 64 && uint64_t{surfels} >> (bits - ray_bits) != 0) ++bits;
  sort_pairs(records, bits, hits.keys.data(), hits.sorted_keys.data(), hits.places.data(),
             hits.sorted_places.data(), hits.sort_scratch);
  const HitRows rows{hits.sorted_keys.data(),
                     hits.sorted_places.data(),
                     hits.parts.data(),
                     hits.basis.data(),
                     ray_bits,
                     numbers};
  int64_t count = records;
  for (int level = 0;; ++level) {
    const int64_t spans = (count + span_rows - 1) / span_rows;
    const size_t to = level % 2 == 0 ? 0 : 1;
    hits.end_surfels[to].place(Device::cuda).resize({2 * spans});
    hits.end_sums[to].place(Device::cuda).resize({2 * spans, row_values});
    const Ends ends{hits.end_surfels[to].data(), hits.end_sums[to].data()};
    const Grid grid{blocks_for(spans * warp_lanes, sum_threads), sum_threads};
    if (level == 0) {
      launch("trace: sums of hits", grid, add_runs<HitRows>, rows, count, totals, ends);
    } else {
      const EndRows from{hits.end_surfels[1 - to].data(), hits.end_sums[1 - to].data()};
      launch("trace: sums of spans", grid, add_runs<EndRows>, from, count, totals, ends);
    }
    if (spans == 1) return;
    count = 2 * spans;
  }
}

}  // namespace traceflow::trace::cuda
