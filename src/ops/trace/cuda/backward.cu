#include "ops/trace/cuda/forward.h"
#include "ops/trace/cuda/sh.h"
#include "ops/trace/trace_place_backward.h"

namespace traceflow::trace::cuda {

using namespace traceflow::cuda;

namespace {

constexpr int backward_threads = 128;

// What the lanes of a block add to their surfels, one row each, so that a warp adds a row together.
struct Rows {
  float basis[backward_threads][17];  // of the lane's ray; the odd width puts the rows in different banks
  float passed[backward_threads][3];
  float part[backward_threads][part::count + 1];
  uint32_t surfel[backward_threads];
};

// Iterates over a ray's records from the last hit to the first.
class RecordIterator {
 public:
  __device__ RecordIterator(const Record* records, uint32_t last_head)
      : records_(records), next_head_(last_head) {}

  // Moves to the next hit, at place(). Returns false if there is none.
  __device__ bool next() {
    if (left_ == 0) {
      if (next_head_ == no_record) return false;
      head_ = next_head_;
      const Record record = load_quads(records_[head_]);
      next_head_ = record.name;
      left_ = __float_as_uint(record.distance);
    }
    --left_;
    return true;
  }
  __device__ uint32_t place() const { return head_ + 1 + left_; }
  __device__ bool is_first_of_pass() const { return left_ == 0; }
  __device__ uint32_t head() const { return head_; }

 private:
  const Record* records_;
  uint32_t next_head_, head_ = 0, left_ = 0;
};

// The state of a ray, from its last hit to its first.
template <int degree>
struct RayBackward {
  UnitRay ray;
  RaySums sums{};
  Vec3<float> grad_colour{0};
  float grad_alpha = 0, grad_distance = 0;  // distance in scene units
  float behind = 0;                         // Σ weight · dL/dweight over the hits behind
  GradRay grad_ray;                         // dL/d(ray) through the geometry of the hits
  float grad_basis[sh_coefficients(degree)] = {};

  __device__ void load(const BackwardTask& task, int64_t i, int64_t r) {
    sums = task.sums[i];
    if (task.grad_colour) grad_colour = load3<float>(task.grad_colour + 3 * r);
    if (task.grad_alpha) grad_alpha = task.grad_alpha[r];
    if (task.grad_distance) grad_distance = task.grad_distance[r] / ray.length;
    behind = sums.remaining * dot(grad_colour, task.rays.background);
  }

  // Computes what a hit adds to its surfel: dL/dcolour and the contributions.
  __device__ void pass(const BackwardTask& task, const Record& hit, const float* basis, float* passed,
                       float* parts) {
    constexpr int numbers = 3 * sh_coefficients(degree);
    const float* sh = task.rays.sh + int64_t{numbers} * hit.name;
    const float weight = hit.alpha * hit.transmittance;
    const Vec3<float> raw = raw_colour<degree>(sh, basis);
    float own = grad_alpha + grad_distance * (hit.distance - sums.distance) / sums.alpha;
    for (int c = 0; c < 3; ++c) {
      own += std::fmax(raw[c], 0.0F) * grad_colour[c];
      passed[c] = raw[c] > 0 ? weight * grad_colour[c] : 0;
    }
    for_each_coefficient<degree>(
        sh, [&](int k, int c, float number) { grad_basis[k] = std::fma(number, passed[c], grad_basis[k]); });
    const float grad = blend_alpha_gradient(hit.transmittance, hit.alpha, own, behind);
    behind += weight * own;
    const float grad_exponent = hit.alpha >= task.rays.rules.blend.alpha_max ? 0 : grad * hit.alpha;
    place_backward(load_quads(task.frames[hit.name]), ray,
                   {hit.distance, grad_exponent, weight * grad_distance / sums.alpha}, parts, grad_ray);
  }

  __device__ void finish(const BackwardTask& task, int64_t r) const {
    const Vec3<float> by_colour = sh_basis_backward(degree, ray.direction, grad_basis);
    store3(task.grad_origins + 3 * r, grad_ray.origin);
    store3(task.grad_directions + 3 * r,
           direction_backward(ray, by_colour + grad_ray.direction, grad_distance, sums.distance));
    if (task.grad_widths) task.grad_widths[r] = grad_ray.width;
  }
};

// Adds the rows of the lanes that hit the same surfel to that surfel. All lanes take part, so that adjacent
// addresses are updated together.
template <int degree>
__device__ void add_group(const Rows& rows, int first_row, unsigned group, const BackwardTask& task) {
  constexpr int numbers = 3 * sh_coefficients(degree);
  const auto row_of = [first_row](unsigned lanes) { return first_row + __ffs(static_cast<int>(lanes)) - 1; };
  const uint32_t surfel = rows.surfel[row_of(group)];
  for (int v = static_cast<int>(threadIdx.x) % warp_lanes; v < numbers + static_cast<int>(part::count);
       v += warp_lanes) {
    float sum = 0;
    for (unsigned left = group; left != 0; left &= left - 1) {
      const int row = row_of(left);
      sum += v < numbers ? rows.basis[row][v / 3] * rows.passed[row][v % 3] : rows.part[row][v - numbers];
    }
    atomicAdd(v < numbers ? task.grad_sh + int64_t{numbers} * surfel + v
                          : task.surfel_sums[surfel].value + (v - numbers),
              sum);
  }
}

// Adds the rows of all lanes that have one. All lanes of the warp take part.
template <int degree>
__device__ void add_rows(const Rows& rows, bool mine, const BackwardTask& task) {
  __syncwarp();
  const int first = static_cast<int>(threadIdx.x) / warp_lanes * warp_lanes;
  const unsigned same = __match_any_sync(full_warp, mine ? rows.surfel[threadIdx.x] : no_record);
  for (unsigned left = __ballot_sync(full_warp, mine); left != 0;) {
    const unsigned group = __shfl_sync(full_warp, same, __ffs(static_cast<int>(left)) - 1);
    add_group<degree>(rows, first, group, task);
    left &= ~group;
  }
  __syncwarp();
}

// Stores a lane's row, for sums in a fixed order.
__device__ void keep_row(const Rows& rows, int64_t i, const RecordIterator& record,
                         const BackwardTask& task) {
  const uint32_t place = record.place();
  HitParts parts{};
  for (size_t k = 0; k < part::count; ++k) parts.part[k] = rows.part[threadIdx.x][k];
  for (int c = 0; c < 3; ++c) parts.passed[c] = rows.passed[threadIdx.x][c];
  parts.ray = static_cast<uint32_t>(i);
  store_quads(parts, task.parts[place]);
  task.keys[place] = uint64_t{rows.surfel[threadIdx.x]} << task.ray_bits | static_cast<uint64_t>(i);
  task.places[place] = place;
  if (!record.is_first_of_pass()) return;
  task.keys[record.head()] = task.head_key;
  task.places[record.head()] = record.head();
}

// One thread per ray, back to front.
template <int degree, bool in_order>
__global__ void __launch_bounds__(backward_threads) backward_kernel(BackwardTask task) {
  __shared__ Rows rows;
  const int64_t i = task.rays.own();
  const bool exists = i < task.rays.last;
  const int64_t r = exists ? task.rays.callers(i) : 0;
  float* const basis = rows.basis[threadIdx.x];
  RayBackward<degree> ray;
  uint32_t last_head = exists ? task.last_head[i] : no_record;
  if (last_head != no_record) {
    make_unit_ray(task.rays.rays, r, ray.ray);
    sh_basis(degree, ray.ray.direction, basis);
    ray.load(task, i, r);
    for (int k = 0; in_order && k < sh_coefficients(degree); ++k) task.basis[16 * i + k] = basis[k];
  }
  RecordIterator record(task.records, last_head);
  bool mine = record.next();
  while (__any_sync(full_warp, mine)) {
    if (mine) {
      const Record hit = load_quads(task.records[record.place()]);
      rows.surfel[threadIdx.x] = hit.name;
      ray.pass(task, hit, basis, rows.passed[threadIdx.x], rows.part[threadIdx.x]);
    }
    if constexpr (in_order) {
      if (mine) keep_row(rows, i, record, task);
    } else {
      add_rows<degree>(rows, mine, task);
    }
    mine = mine && record.next();
  }
  if (!exists) return;
  if (last_head != no_record) {
    ray.finish(task, r);
  } else {
    store3(task.grad_origins + 3 * r, Vec3<float>(0));
    store3(task.grad_directions + 3 * r, Vec3<float>(0));
    if (task.grad_widths) task.grad_widths[r] = 0;
  }
}

template <int degree>
void start(const BackwardTask& task) {
  const Grid grid{blocks_for(task.rays.last - task.rays.first, backward_threads), backward_threads};
  if (task.parts) {
    launch("trace: backward in order", grid, backward_kernel<degree, true>, task);
  } else {
    launch("trace: backward", grid, backward_kernel<degree, false>, task);
  }
}

}  // namespace

void trace_backward(int degree, const BackwardTask& task) {
  void (*const starts[])(const BackwardTask&) = {start<0>, start<1>, start<2>, start<3>};
  starts[degree](task);
}

}  // namespace traceflow::trace::cuda
