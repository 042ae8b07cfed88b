#pragma once

#include <cstdint>

#include "math/surfel_hit.h"
#include "ops/raster/raster.h"

// Shared definitions of the stages of the fast path. The image is divided into tiles of 16×16 pixels, and
// tiles into blocks of 4×4 pixels, which vectors process. Forward: project_surfels() projects every surfel,
// bin() lists the surfels of each tile front to back, and each tile is blended independently. Backward: each
// tile independently computes sums per (tile, surfel); these are added per surfel in tile order and
// propagated to its parameters.
namespace traceflow::raster {

inline constexpr int tile_edge = 16;
inline constexpr int block_edge = 4;
inline constexpr int blocks_per_row = tile_edge / block_edge;
inline constexpr int blocks_per_tile = blocks_per_row * blocks_per_row;
inline constexpr int pixels_per_block = block_edge * block_edge;
inline constexpr int pixels_per_tile = tile_edge * tile_edge;

// A surfel on the screen. Positions are relative to the anchor, a whole pixel near the projected centre, so
// that single precision suffices. The linear forms are those of math/surfel_projection.h.
struct alignas(16) Splat {
  float anchor_x, anchor_y;  // pixels
  float centre_x,
      centre_y;         // the projected centre; far_away without low-pass, so that the low-pass never wins
  float u_x, u_y, u_1;  // u·w = u_x x + u_y y + u_1
  float v_x, v_y, v_1;
  float w_x, w_y, w_1;
  float w_max;    // hits beyond the near plane have 0 < w ≤ w_max
  float rho_max;  // ρ at which α reaches alpha_min
  float log2_opacity;
  float z_plane, inverse_z_plane;    // for a hit in the plane: z = z_plane / w
  float z_centre, inverse_z_centre;  // for a hit of the low-pass
  float colour[3];
  float tint;
  float normal[3];  // world axes, facing the camera
  // The ellipse of the hits in the plane; ellipse_x is NaN if no ellipse bounds them. The slopes give the
  // minima of its quadratic form along vertical lines, y - ellipse_y = slope_y (x - ellipse_x), and along
  // horizontal lines.
  float ellipse_x, ellipse_y;
  float slope_x, slope_y;
  float signed_roughness;  // negative, also as -0, if a body carries the surfel

  // The value of the silhouette.
  TRACEFLOW_HD float in_body() const { return std::signbit(signed_roughness) ? 1.0F : 0.0F; }
  TRACEFLOW_HD float roughness() const { return std::abs(signed_roughness); }
  static constexpr float far_away = 1e15F;
  TRACEFLOW_HD bool has_low_pass() const { return centre_x < far_away; }
};
static_assert(sizeof(Splat) == 128);

// The tiles in which a surfel can be visible, as half-open ranges; empty if it is not drawn.
struct Bounds {
  int32_t tile_x0 = 0, tile_x1 = 0, tile_y0 = 0, tile_y1 = 0;

  TRACEFLOW_HD int64_t tiles() const { return int64_t{tile_x1 - tile_x0} * (tile_y1 - tile_y0); }
};

// An element of a tile's list.
struct TileEntry {
  uint32_t surfel;
  // Index of the pair (surfel, tile) in surfel order: entry_begin[surfel] + the index of the tile among the
  // surfel's tiles, row by row.
  uint32_t entry;
};

// dL/d(splat), summed over pixels: a number per member, or a vector of lanes. The CUDA device and the CPU
// reduce the members in this order.
template <class Value>
struct BasicSplatGradient {
  Value u_x, u_y, u_1;
  Value v_x, v_y, v_1;
  Value w_x, w_y, w_1;
  Value z_plane;
  Value centre_x, centre_y, z_centre;
  Value log_opacity;  // opacity · dL/dopacity
  Value colour[3];
  Value tint;
  Value normal[3];
  Value roughness;
  Value unused[2];
};
using SplatGradient = BasicSplatGradient<float>;
static_assert(sizeof(SplatGradient) == 24 * sizeof(float));

// The outputs that have a gradient. The loops skip the others.
enum class Asked {
  colour,    // colour, tint, silhouette, roughness and alpha
  geometry,  // also normal and expected depth
  all        // also median depth and distortion
};
inline Asked asked_by(const OutputGradient& g) {
  if (!g.median_depth.empty() || !g.distortion.empty()) return Asked::all;
  return g.normal.empty() && g.depth.empty() ? Asked::colour : Asked::geometry;
}

// What forward saves for backward, for 16 pixels. A vector is loaded at once.
struct SavedBlock {
  alignas(64) float transmittance[pixels_per_block];
  alignas(64) float alpha[pixels_per_block];
  alignas(64) float depth[pixels_per_block];
  // Σ w m' and Σ w m'², m' = far·near/(far-near) · (1/z_first - 1/z). m' is relative to the first hit to
  // avoid cancellation of squares.
  alignas(64) float m[pixels_per_block];
  alignas(64) float m2[pixels_per_block];
  alignas(64) float inverse_z[pixels_per_block];  // 1/z_first
  // Indices in the tile's list of the last blended hit and of the median hit, -1 for none.
  alignas(64) int32_t last[pixels_per_block];
  alignas(64) int32_t median[pixels_per_block];
};

struct Saved {
  int width = 0, height = 0;
  int tile_columns = 0, tile_rows = 0;
  int64_t count = 0;
  bool has_silhouette = false, has_roughness = false;
  float rho_per_pixel2 = 2;  // of the low-pass: ρ divided by the squared distance to the centre

  Tensor<Splat> splats;          // by surfel; unspecified if the bounds are empty
  Tensor<Bounds> bounds;         // by surfel
  Tensor<uint32_t> entry_begin;  // by surfel, plus one
  Tensor<uint32_t> tile_begin;   // by tile, plus one
  Tensor<TileEntry> entries;     // by tile; front to back for sort = centre, by index for sort = hit
  Tensor<uint16_t> touched;      // by entry: bit b is set if a pixel of block b blended the surfel
  Tensor<SavedBlock> blocks;     // by tile, then by block; on the CPU only

  // What forward saves per pixel on the CUDA device, H×W each, as in SavedBlock.
  struct Pixels {
    Tensor<float> transmittance, alpha, depth, m, m2, inverse_z;
    Tensor<int32_t> last;    // for sort = hit: the number of blended hits
    Tensor<int32_t> median;  // for sort = hit: the index of the median hit among them
  } pixels;

  // Memory of bin() and backward, reused by the next call.
  struct Scratch {
    Tensor<uint64_t> keys, keys_sorted;
    Tensor<uint32_t> tile_counts;
    Tensor<SplatGradient> gradients;  // by entry
    // On the CUDA device only.
    Tensor<uint32_t> depth_keys, depth_keys_sorted, surfels, surfels_sorted;
    Tensor<int32_t> counts;
    Tensor<int64_t> offsets;
    Tensor<uint32_t> tile_keys, tile_keys_sorted, places, places_sorted;
    Tensor<TileEntry> unsorted;
    Tensor<CameraGradient<double>> camera;
    Tensor<uint8_t> bytes;
  };
  mutable Scratch scratch;

  int64_t tiles() const { return int64_t{tile_columns} * tile_rows; }
};

// Memory of one thread for the lists of its tile.
struct TileMemory {
  Tensor<uint32_t> reached, places;
};

// The limits in Options, as the kernels use them.
struct KernelOptions {
  float alpha_min;
  float alpha_max;
  float transmittance_min;
  float m_scale;  // far·near/(far - near)
  Vec3<float> background;

  explicit KernelOptions(const Options& o)
      : alpha_min(o.alpha_min),
        alpha_max(o.alpha_max),
        transmittance_min(o.transmittance_min),
        m_scale(o.far_plane * o.near_plane / (o.far_plane - o.near_plane)),
        background(o.background) {}
};

// Flags a surfel that any pixel blended.
struct IsVisible {
  const uint32_t* entry_begin;
  const uint16_t* touched;
  uint8_t* flags;

  TRACEFLOW_HD bool is_visible(int64_t i) const {
    uint16_t blocks = 0;
    for (uint32_t entry = entry_begin[i]; entry < entry_begin[i + 1]; ++entry)
      blocks = static_cast<uint16_t>(blocks | touched[entry]);
    return blocks != 0;
  }
  TRACEFLOW_HD void operator()(int64_t i) const { flags[i] = is_visible(i) ? 1 : 0; }
};

// Sets splats and bounds.
void project_surfels(const PosedSurfels& surfels, const Camera<float>& camera, const Options& options,
                     Saved& saved);
// Sets entry_begin, tile_begin and entries.
void bin(SortOrder order, Saved& saved);
// Blends every tile.
void blend(const Options& options, Output& output, Saved& saved);
// Sets scratch.gradients of entries with touched != 0.
void blend_backward(const Options& options, const Saved& saved, const OutputGradient& grad_output);
// Propagates scratch.gradients to the surfels and the camera.
void project_surfels_backward(const PosedSurfels& surfels, const Camera<float>& camera, const Saved& saved,
                              InputGradient& gradient);

}  // namespace traceflow::raster
