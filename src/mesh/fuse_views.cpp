#include "mesh/fuse_views.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/robust.h"
#include "ops/surface/surface_kernels.h"

namespace traceflow::mesh {

namespace {

// Of the size of the views that are rendered to find the box.
constexpr int shrink = 8;

[[noreturn]] void no_surface() {
  throw InputError(
      "mesh", "", "no surface in the views", "at least one triangle",
      "lower mesh.min_alpha or mesh.min_triangles, raise mesh.max_depth, or choose other cameras");
}

// The camera of a smaller image of the same view.
Camera<float> shrunk(Camera<float> camera) {
  const auto scale = [](int& size, float& focal, float& centre) {
    const int small = std::max(2, size / shrink);
    const float factor = static_cast<float>(small) / static_cast<float>(size);
    focal *= factor;
    centre *= factor;
    size = small;
  };
  scale(camera.width, camera.focal_x, camera.centre_x);
  scale(camera.height, camera.focal_y, camera.centre_y);
  return camera;
}

// Adds the coordinates of what a view shows.
void add_points(const DepthView& view, const FusionOptions& options,
                std::array<std::vector<float>, 3>& points) {
  for (int64_t i = 0; i < view.depth.size(); ++i) {
    const float depth = view.depth[i];
    if (!(view.alpha[i] >= options.min_alpha) || !(depth > 0) || !std::isfinite(depth) ||
        (options.max_depth > 0 && depth > options.max_depth)) {
      continue;
    }
    const Vec3<float> point =
        view.camera.position +
        depth * surface::pixel_ray(view.camera, i / view.camera.width, i % view.camera.width);
    for (int c = 0; c < 3; ++c) points[static_cast<size_t>(c)].push_back(point[c]);
  }
}

// The longest side of the box around the points, without a hundredth of them at each side.
float longest_side(std::array<std::vector<float>, 3>& points) {
  float longest = 0;
  for (std::vector<float>& values : points) {
    if (values.empty()) no_surface();
    const size_t outside = values.size() / 100;
    const float low = ranked(values, outside), high = ranked(values, values.size() - 1 - outside);
    longest = std::max(longest, high - low);
  }
  if (!(longest > 0)) no_surface();
  return longest;
}

}  // namespace

DepthView depth_view(const Frame& frame, float depth_ratio) {
  DepthView view;
  view.camera = frame.camera;
  view.depth = frame.raster.depth.on(Device::cpu);
  view.normal = frame.raster.normal.on(Device::cpu);
  view.colour = frame.colour.on(Device::cpu);
  view.alpha = frame.raster.alpha.on(Device::cpu);
  Tensor<float> fetched;
  const Tensor<float>& median = on_host(frame.raster.median_depth, fetched);
  for (int64_t i = 0; i < view.depth.size(); ++i)
    view.depth[i] = surface::surface_depth(view.depth[i], median[i], depth_ratio);
  return view;
}

TriangleMesh fuse_views(const viz::Subject& subject, const std::vector<viz::Shot>& shots, float time,
                        const FusionOptions& options, const FuseProgress& progress) {
  options.validate();
  require(!shots.empty(), "a surface is fused from at least one view");
  const SceneNormalisation& normalisation = subject.scene.normalisation;
  FusionOptions in_scene = options;
  in_scene.voxel *= static_cast<float>(normalisation.scale);
  in_scene.max_depth *= static_cast<float>(normalisation.scale);

  Renderer renderer(subject.render);
  FrameRequest request = subject.request;
  request.time = time;
  const bool finds_box = options.voxel == 0;
  size_t done = 0;
  const auto render = [&](const Camera<float>& camera) {
    request.camera = camera;
    const Frame& frame = renderer.forward(subject.scene, request);
    request.reuse_pose = true;
    return depth_view(frame, subject.render.depth_ratio);
  };
  const auto report = [&] {
    ++done;
    if (progress) progress(done, shots.size() * (finds_box ? 2 : 1));
  };

  if (finds_box) {
    std::array<std::vector<float>, 3> points;
    const FrameRequest full = request;
    request.specular = false;
    request.most_samples = 1;
    for (const viz::Shot& shot : shots) {
      add_points(render(shrunk(shot.camera)), in_scene, points);
      report();
    }
    in_scene.voxel = longest_side(points) / static_cast<float>(options.resolution);
    request = full;
  }
  Fusion fusion(in_scene);
  for (const viz::Shot& shot : shots) {
    fusion.integrate(render(shot.camera));
    report();
  }
  TriangleMesh mesh = fusion.extract();
  if (mesh.triangle_count() == 0) no_surface();
  for (int64_t i = 0; i < mesh.vertex_count(); ++i)
    store3(mesh.vertices.row(i), normalisation.in_capture(load3<double>(mesh.vertices.row(i))));
  return mesh;
}

}  // namespace traceflow::mesh
