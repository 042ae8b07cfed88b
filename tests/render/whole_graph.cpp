#include "render/whole_graph.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "support/loss_values.h"

namespace traceflow::whole_graph {

namespace {

constexpr int width = 22;
constexpr int height = 14;

// Surfels on a few layers across the view, each wide enough that no pixel is near a cut-off of its own.
Surfels wall_of_surfels(int count, float distance, float spread, float scale, bool tint, Random& random) {
  Surfels s;
  s.position.reset({count, 3});
  s.log_scale.reset({count, 2});
  s.rotation.reset({count, 4});
  s.opacity_logit.reset({count});
  s.sh.reset({count, 9, 3});
  if (tint) s.tint_logit.reset({count});
  if (tint) s.roughness_logit.reset({count});
  for (int64_t i = 0; i < count; ++i) {
    const float depth = distance + 0.21F * static_cast<float>(i);
    store3(s.position.row(i), Vec3<float>(spread * random.normal(), spread * random.normal(), depth));
    s.log_scale(i, 0) = std::log(scale) + 0.2F * static_cast<float>(random.normal());
    s.log_scale(i, 1) = std::log(scale) + 0.2F * static_cast<float>(random.normal());
    s.rotation(i, 0) = 1;
    for (int64_t k = 1; k < 4; ++k) s.rotation(i, k) = 0.12F * static_cast<float>(random.normal());
    s.opacity_logit[i] = static_cast<float>(random.uniform(-0.8, 0.3));
    for (int64_t k = 0; k < 27; ++k) s.sh.row(i)[k] = 0.25F * static_cast<float>(random.normal());
    if (tint) s.tint_logit[i] = 0.3F * static_cast<float>(random.normal());
    if (tint) s.roughness_logit[i] = -2.5F + 0.3F * static_cast<float>(i % 5);
  }
  return s;
}

Field small_field(int outputs, Random& random) {
  NetworkOptions shape;
  shape.depth = 3;
  shape.width = 16;
  shape.skip = 2;
  shape.position_frequencies = 2;
  shape.time_frequencies = 2;
  Field field = make_field(shape, outputs, random);
  for (float& w : field.head_weight.values()) w = 0.05F * static_cast<float>(random.normal());
  for (float& b : field.head_bias.values()) b = 0.02F * static_cast<float>(random.normal());
  return field;
}

Tensor<double> random_image(Random& random, bool unit) {
  Tensor<double> image({height, width, 3});
  for (double& v : image.values()) v = random.uniform();
  for (int64_t i = 0; unit && i < height * width; ++i) {
    const Vec3<double> n = normalize(Vec3<double>(random.normal(), random.normal(), random.normal() - 2));
    store3(image.data() + 3 * i, n);
  }
  return image;
}

std::vector<float> flat(const SceneGradient& g, const Scene& scene) {
  std::vector<float> all;
  const auto take = [&](const Tensor<float>& placed) {
    const Tensor<float> t = placed.on(Device::cpu);
    all.insert(all.end(), t.values().begin(), t.values().end());
  };
  g.main.for_each([&](const std::string&, const Tensor<float>& t) { take(t); });
  g.main_field.for_each([&](const std::string&, const Tensor<float>& t) { take(t); });
  if (scene.environment_map) take(g.environment_map.logit);
  if (scene.specular == Specular::environment_map) {
    g.environment_map.field->for_each([&](const std::string&, const Tensor<float>& t) { take(t); });
  } else {
    g.environment.for_each([&](const std::string&, const Tensor<float>& t) { take(t); });
    g.environment_field.for_each([&](const std::string&, const Tensor<float>& t) { take(t); });
  }
  for (int i = 0; i < 9; ++i) all.push_back(g.camera.camera_from_world[i / 3][i % 3]);
  for (int i = 0; i < 3; ++i) all.push_back(g.camera.position[i]);
  return all;
}

FrameGradient frame_gradient(const Frame& frame, const reference::Setting& s) {
  const Device device = frame.colour.device();
  const Tensor<float> target = convert<float>(s.target).on(device);
  const Tensor<float> prior = convert<float>(s.prior).on(device);
  FrameGradient g;
  g.colour.place(device).reset(frame.colour.shape());
  g.normal.place(device).reset(frame.raster.normal.shape());
  g.alpha.place(device).reset(frame.raster.alpha.shape());
  g.pseudo_normal.place(device).reset(frame.raster.normal.shape());
  g.distortion.place(device).reset(frame.raster.distortion.shape());
  loss::l1(frame.colour, target, s.weights.l1, g.colour);
  loss::ssim_loss(frame.colour, target, s.weights.ssim, g.colour);
  loss::normal_consistency(frame.raster.normal, frame.raster.alpha, frame.pseudo_normal, s.weights.normal,
                           g.normal, g.alpha, g.pseudo_normal);
  loss::normal_prior(frame.raster.normal, prior, s.weights.normal_prior, g.normal);
  g.depth.place(device).reset(frame.raster.depth.shape());
  loss::depth_prior(frame.raster.depth, convert<float>(s.depth_prior).on(device), s.weights.depth_prior,
                    g.depth);
  loss::distortion(frame.raster.distortion, s.weights.distortion, g.distortion);
  return g;
}

}  // namespace

Case make_case(Graph graph) {
  Random random(7);
  Case c;
  c.scene.extent = 1;
  c.scene.main = wall_of_surfels(7, 2.0F, 0.25F, 1.1F, true, random);
  // The environment stands behind the camera, where the mirrored rays go.
  c.scene.environment = wall_of_surfels(8, -3.2F, 0.8F, 1.6F, false, random);
  c.scene.main_field = small_field(residual::main_outputs, random);
  c.scene.environment_field = small_field(residual::environment_outputs, random);
  if (graph == Graph::reflected_map || graph == Graph::reflected_far) {
    c.scene.environment_map.emplace();
    c.scene.environment_map->logit.reset({6 * 5, 5, 3});
    for (float& v : c.scene.environment_map->logit.values()) v = static_cast<float>(random.normal());
  }
  if (graph == Graph::reflected_map) {
    c.scene.specular = Specular::environment_map;
    c.scene.environment_map->field = small_field(3, random);
  }
  Camera<float>& camera = c.request.camera;
  camera.width = width;
  camera.height = height;
  camera.focal_x = 21;
  camera.focal_y = 23;
  camera.centre_x = 10.3F;
  camera.centre_y = 7.4F;
  camera.position = {0.1F, -0.05F, 0.02F};
  c.request.time = 0.4F;
  c.request.sh_degree_main = 2;
  c.request.sh_degree_environment = 2;
  c.request.deform_main = c.request.deform_environment = graph != Graph::diffuse;
  c.request.specular = graph != Graph::diffuse && graph != Graph::diffuse_deformed;
  c.request.pseudo_normals = true;
  c.options.samples = graph == Graph::several_samples ? 2 : 1;
  c.options.depth_ratio = 0.3F;
  c.options.raster.sort = raster::SortOrder::centre;
  c.options.raster.near_plane = 0.1F;
  c.options.raster.far_plane = 20;
  c.options.select.min_alpha = 0;
  c.options.select.min_tint = 0;
  c.options.raster.background = {0.2F, 0.3F, 0.1F};

  c.parameters.main = convert<double>(c.scene.main);
  c.parameters.environment = convert<double>(c.scene.environment);
  c.parameters.main_field = convert<double>(*c.scene.main_field);
  c.parameters.environment_field = convert<double>(*c.scene.environment_field);
  if (c.scene.environment_map) {
    c.parameters.map.emplace();
    c.parameters.map->logit = convert<double>(c.scene.environment_map->logit);
    if (c.scene.environment_map->field)
      c.parameters.map->field = convert<double>(*c.scene.environment_map->field);
  }
  c.parameters.camera = convert<double>(camera);
  c.setting.raster = c.options.raster_options(1);
  c.setting.trace = c.options.trace_options(1);
  c.setting.samples = c.options.samples;
  c.setting.depth_ratio = 0.3F;
  c.setting.time = 0.4F;
  c.setting.deform = c.request.deform_main;
  c.setting.specular = c.request.specular;
  c.setting.target = random_image(random, false);
  c.setting.prior = random_image(random, true);
  // The wall is 2 away, so that some pixels are in the quadratic part of the loss and some are beyond it.
  c.setting.depth_prior = random_tensor<double>({height, width}, random, 1.7, 2.3);
  c.setting.main_points = c.parameters.main.position;
  c.setting.environment_points = c.parameters.environment.position;
  if (graph == Graph::reflected_map)
    c.setting.map_directions = reference::reflection_directions(c.parameters, c.setting);
  return c;
}

std::vector<float> renderer_gradient(const Case& c, Device device) {
  Scene scene = c.scene;
  scene.move_to(device);
  Renderer renderer(c.options);
  const Frame& frame = renderer.forward(scene, c.request, true);
  const FrameGradient grad_frame = frame_gradient(frame, c.setting);
  SceneGradient gradient;
  gradient.reset(scene);
  renderer.backward(scene, c.request, Trainable{}, grad_frame, gradient);
  return flat(gradient, c.scene);
}

void expect_agreement_with_reference(Graph graph, Device device) {
  Case c = make_case(graph);
  reference::Gradient expected;
  reference::loss(c.parameters, c.setting, &expected);
  const std::vector<float> found = renderer_gradient(c, device);
  size_t offset = 0;
  for_each_group(c.parameters, expected,
                 [&](const std::string& name, std::span<double>, std::span<double> g) {
                   double error = 0;
                   double size = 0;
                   ASSERT_LE(offset + g.size(), found.size()) << name;
                   for (size_t i = 0; i < g.size(); ++i) {
                     error = std::max(error, std::abs(g[i] - static_cast<double>(found[offset + i])));
                     size = std::max(size, std::abs(g[i]));
                   }
                   offset += g.size();
                   EXPECT_LE(error, 2e-3 * size + 1e-7) << name << ", largest " << size;
                 });
  EXPECT_EQ(offset, found.size());
}

}  // namespace traceflow::whole_graph
