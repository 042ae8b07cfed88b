#pragma once

#include "base/options.h"
#include "base/tensor.h"
#include "math/camera.h"
#include "mesh/block_grid.h"
#include "mesh/mesh.h"

// Fusion of depth images to one surface: a truncated signed distance function (TSDF) in blocks of voxels near
// what the images show (Curless and Levoy 1996).
namespace traceflow::mesh {

// How depth images are fused. Lengths are those of the cameras; for fuse_views, of the capture.
struct FusionOptions {
  float voxel = 0;
  int resolution = 512;
  float truncation = 4;
  float max_depth = 0;
  float min_alpha = 0.5F;
  int components = 50;
  int min_triangles = 50;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("voxel", voxel, "capture units",
            "Side of a voxel; 0: the longest side of the box around what the views show, over `resolution`.");
    v.field("resolution", resolution, "voxels", "Voxels along the longest side of the box, if voxel is 0.");
    v.field("truncation", truncation, "voxels",
            "Distance from the surface within which a view counts as seeing it.");
    v.field("max_depth", max_depth, "capture units", "Surfaces at larger depth are left out; 0: none are.");
    v.field("min_alpha", min_alpha, "", "Pixels with a lower alpha show no surface.");
    v.field("components", components, "",
            "Number of connected components that are kept, those with most triangles; 0: all.");
    v.field("min_triangles", min_triangles, "triangles",
            "Connected components with fewer triangles are removed.");
  }
  // Throws InputError.
  void validate() const;
};

// The layers of a rendered image, on the host. The camera's units and world are those of the surface.
struct DepthView {
  Camera<float> camera;
  Tensor<float> depth;   // H×W, along the camera's z; 0 or less, or not finite: none
  Tensor<float> normal;  // H×W×3, world axes, facing the camera, any length
  Tensor<float> colour;  // H×W×3, sRGB, 0 to 1
  Tensor<float> alpha;   // H×W
};

// A surface that grows by views.
class Fusion {
 public:
  // Throws InputError for invalid options. The voxel must not be 0.
  explicit Fusion(const FusionOptions& options);

  // Adds a view. A voxel's distance becomes the mean over the views, weighted by the cosine of the angle
  // between surface and view, and less the farther it is behind the surface. What is before the surface is
  // known to be empty; what is a truncation or more behind it stays as it was. Pixels do not count that have
  // too little alpha, are seen at a grazing angle (84° or more), or are at a jump of the depth, where
  // rendered depth lies between two surfaces. The result depends on the order of views, but not on the number
  // of threads. Throws InputError if the grid would become too large; the surface is then as before.
  void integrate(const DepthView& view);

  // The fused surface without its small components. Where nothing was observed there is none.
  TriangleMesh extract() const;

 private:
  FusionOptions options_;
  BlockGrid grid_;
};

}  // namespace traceflow::mesh
