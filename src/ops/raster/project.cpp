#include "ops/raster/project.h"

#include "base/parallel.h"

namespace traceflow::raster {

void project_surfels(const PosedSurfels& surfels, const Camera<float>& camera, const Options& options,
                     Saved& saved) {
  saved.count = surfels.count();
  saved.has_silhouette = !surfels.in_body.empty();
  saved.has_roughness = surfels.has_roughness();
  saved.rho_per_pixel2 = options.low_pass > 0 ? 2 / (options.low_pass * options.low_pass) : 2;
  saved.width = camera.width;
  saved.height = camera.height;
  saved.tile_columns = (camera.width + tile_edge - 1) / tile_edge;
  saved.tile_rows = (camera.height + tile_edge - 1) / tile_edge;
  const Device device = surfels.position.device();
  saved.splats.place(device).resize({saved.count});
  saved.bounds.place(device).resize({saved.count});
  parallel_for(device, "raster: project", saved.count,
               ProjectSurfel(view_of(surfels), camera, options, saved.splats.data(), saved.bounds.data()),
               256);
}

}  // namespace traceflow::raster
