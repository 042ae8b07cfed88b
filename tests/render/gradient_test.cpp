#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "render/reference_graph.h"
#include "render/renderer.h"
#include "support/loss_values.h"

// The end-to-end gradient test: a small scene through every phase's graph. The references' analytic gradient
// is held against central differences of the loss along a random direction in every parameter group of both
// sets, both networks, the map and the camera; then the renderer's single-precision gradient against the
// references'.
namespace traceflow {
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

enum class Graph { diffuse, diffuse_deformed, reflected, reflected_map };

struct Case {
  Scene scene;
  FrameRequest request;
  reference::Parameters parameters;
  reference::Setting setting;
  RenderOptions options;
};

Case make_case(Graph graph) {
  Random random(7);
  Case c;
  c.scene.extent = 1;
  c.scene.main = wall_of_surfels(7, 2.0F, 0.25F, 1.1F, true, random);
  // The environment stands behind the camera, where the mirrored rays go.
  c.scene.environment = wall_of_surfels(8, -3.2F, 0.8F, 1.6F, false, random);
  c.scene.main_field = small_field(residual::main_outputs, random);
  c.scene.environment_field = small_field(residual::environment_outputs, random);
  if (graph == Graph::reflected_map) {
    c.scene.specular = Specular::environment_map;
    c.scene.environment_map.emplace();
    c.scene.environment_map->logit.reset({6 * 5, 5, 3});
    for (float& v : c.scene.environment_map->logit.values()) v = static_cast<float>(random.normal());
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
  c.request.specular = graph == Graph::reflected || graph == Graph::reflected_map;
  c.request.pseudo_normals = true;
  c.options.depth_ratio = 0.3F;
  c.options.sort = raster::SortOrder::centre;
  c.options.near_plane = 0.1F;
  c.options.far_plane = 20;
  c.options.select.min_alpha = 0;
  c.options.select.min_tint = 0;
  c.options.background = {0.2F, 0.3F, 0.1F};

  c.parameters.main = convert<double>(c.scene.main);
  c.parameters.environment = convert<double>(c.scene.environment);
  c.parameters.main_field = convert<double>(*c.scene.main_field);
  c.parameters.environment_field = convert<double>(*c.scene.environment_field);
  if (c.scene.environment_map) {
    c.parameters.map.emplace();
    c.parameters.map->logit = convert<double>(c.scene.environment_map->logit);
    c.parameters.map->field = convert<double>(*c.scene.environment_map->field);
  }
  c.parameters.camera = convert<double>(camera);
  c.setting.raster = c.options.raster_options(1);
  c.setting.trace = c.options.trace_options(1);
  c.setting.depth_ratio = 0.3F;
  c.setting.time = 0.4F;
  c.setting.deform = c.request.deform_main;
  c.setting.specular = c.request.specular;
  c.setting.target = random_image(random, false);
  c.setting.prior = random_image(random, true);
  c.setting.main_points = c.parameters.main.position;
  c.setting.environment_points = c.parameters.environment.position;
  if (c.parameters.map) c.setting.map_directions = reference::reflection_directions(c.parameters, c.setting);
  return c;
}

// f(name, parameter numbers, gradient numbers) for every group of both sets, both networks, the map and the
// camera.
template <class F>
void for_each_group(reference::Parameters& p, reference::Gradient& g, const F& f) {
  const auto surfels = [&](const std::string& set, BasicSurfels<double>& a, BasicSurfels<double>& b) {
    std::vector<Tensor<double>*> gradients;
    b.for_each([&](const char*, Tensor<double>& t) { gradients.push_back(&t); });
    size_t k = 0;
    a.for_each([&](const char* name, Tensor<double>& t) {
      f(set + "." + name, t.values(), gradients[k++]->values());
    });
  };
  const auto field = [&](const std::string& name, BasicField<double>& a, BasicField<double>& b) {
    std::vector<Tensor<double>*> gradients;
    b.for_each([&](const std::string&, Tensor<double>& t) { gradients.push_back(&t); });
    size_t k = 0;
    a.for_each([&](const std::string& tensor, Tensor<double>& t) {
      f(name + "." + tensor, t.values(), gradients[k++]->values());
    });
  };
  surfels("main", p.main, g.main);
  field("main_field", p.main_field, g.main_field);
  if (p.map) {
    f(std::string("map.logit"), p.map->logit.values(), g.map.logit.values());
    field("map.field", *p.map->field, *g.map.field);
  } else {
    surfels("environment", p.environment, g.environment);
    field("environment_field", p.environment_field, g.environment_field);
  }
  const auto nine = [](Mat3<double>& m) { return std::span<double>(&m[0][0], 9); };
  f(std::string("camera.rotation"), nine(p.camera.camera_from_world), nine(g.camera.camera_from_world));
  f(std::string("camera.position"), std::span<double>(&p.camera.position[0], 3),
    std::span<double>(&g.camera.position[0], 3));
}

class EndToEnd : public testing::TestWithParam<Graph> {};

TEST_P(EndToEnd, ReferenceGradientAgreesWithCentralDifferences) {
  Case c = make_case(GetParam());
  reference::Gradient gradient;
  reference::loss(c.parameters, c.setting, &gradient);
  Random random(11);
  const double step = 1e-6;
  for_each_group(c.parameters, gradient,
                 [&](const std::string& name, std::span<double> x, std::span<double> g) {
                   std::vector<double> direction(x.size());
                   double expected = 0;
                   double size = 0;
                   for (size_t i = 0; i < x.size(); ++i) {
                     direction[i] = random.normal();
                     expected += direction[i] * g[i];
                     size += std::abs(direction[i] * g[i]);
                   }
                   const std::vector<double> start(x.begin(), x.end());
                   const auto loss_at = [&](double t) {
                     for (size_t i = 0; i < x.size(); ++i) x[i] = start[i] + t * direction[i];
                     return reference::loss(c.parameters, c.setting, nullptr);
                   };
                   const double difference = (loss_at(step) - loss_at(-step)) / (2 * step);
                   loss_at(0);
                   EXPECT_NEAR(difference, expected, 1e-4 * size + 1e-8) << name;
                 });
}

std::vector<float> flat(const SceneGradient& g, bool map) {
  std::vector<float> all;
  const auto take = [&](const Tensor<float>& t) {
    all.insert(all.end(), t.values().begin(), t.values().end());
  };
  g.main.for_each([&](const char*, const Tensor<float>& t) { take(t); });
  g.main_field.for_each([&](const std::string&, const Tensor<float>& t) { take(t); });
  if (map) {
    take(g.environment_map.logit);
    g.environment_map.field->for_each([&](const std::string&, const Tensor<float>& t) { take(t); });
  } else {
    g.environment.for_each([&](const char*, const Tensor<float>& t) { take(t); });
    g.environment_field.for_each([&](const std::string&, const Tensor<float>& t) { take(t); });
  }
  for (int i = 0; i < 9; ++i) all.push_back(g.camera.camera_from_world[i / 3][i % 3]);
  for (int i = 0; i < 3; ++i) all.push_back(g.camera.position[i]);
  return all;
}

FrameGradient frame_gradient(const Frame& frame, const reference::Setting& s) {
  const Tensor<float> target = convert<float>(s.target);
  const Tensor<float> prior = convert<float>(s.prior);
  FrameGradient g;
  g.colour.reset(frame.colour.shape());
  g.normal.reset(frame.raster.normal.shape());
  g.pseudo_normal.reset(frame.raster.normal.shape());
  g.distortion.reset(frame.raster.distortion.shape());
  loss::l1(frame.colour, target, s.weights.l1, g.colour);
  loss::ssim_loss(frame.colour, target, s.weights.ssim, g.colour);
  loss::normal_consistency(frame.raster.normal, frame.pseudo_normal, s.weights.normal, g.normal,
                           g.pseudo_normal);
  loss::normal_prior(frame.raster.normal, prior, s.weights.normal_prior, g.normal);
  loss::distortion(frame.raster.distortion, s.weights.distortion, g.distortion);
  return g;
}

TEST_P(EndToEnd, RendererGradientAgreesWithReference) {
  Case c = make_case(GetParam());
  reference::Gradient expected;
  reference::loss(c.parameters, c.setting, &expected);

  Renderer renderer(c.options);
  const Frame& frame = renderer.forward(c.scene, c.request, true);
  const FrameGradient grad_frame = frame_gradient(frame, c.setting);
  SceneGradient gradient;
  gradient.reset(c.scene);
  renderer.backward(c.scene, c.request, Trainable{}, grad_frame, gradient);

  const std::vector<float> found = flat(gradient, c.parameters.map.has_value());
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

INSTANTIATE_TEST_SUITE_P(Graphs, EndToEnd,
                         testing::Values(Graph::diffuse, Graph::diffuse_deformed, Graph::reflected,
                                         Graph::reflected_map));

}  // namespace
}  // namespace traceflow
